"""A page of `mjplug view` in Chromium that shows a model in a state that the test sets, without a server."""

import base64
import gzip
import hashlib
import json
import struct
import time
from pathlib import Path

import cv2
import mujoco
import numpy as np

from mjplug.services.view.catalogue import catalogue
from mjplug.services.view.frame import PAUSED, FrameWriter
from mjplug.services.view.overlays import KINDS, OverlayWriter
from mjplug.services.view.pack import build

PAGE = Path(__file__).parents[2] / "mjplug" / "view" / "page"
ADDRESS = "http://view.invalid/"
TIMEOUT = 60_000
"""Maximum time for a picture on a loaded machine [ms]."""

_FRAME, _OVERLAY = 1, 2
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


class Server:
    """One server as the relay shows it: a model and its state."""

    def __init__(self, model, data=None, name="/mjplug"):
        self.name = name
        self.load(model, data)

    def load(self, model, data=None):
        self.model = model
        self.data = data or mujoco.MjData(model)
        mujoco.mj_forward(self.model, self.data)
        self.content = build(model)
        self.hash = hashlib.sha256(self.content).hexdigest()
        self._frames = FrameWriter(model)
        self._overlays = OverlayWriter(model)
        self.epoch = 0
        self.step = 0

    def info(self):
        return {
            "name": self.name,
            "scene": self.hash,
            "scene_bytes": len(gzip.compress(self.content, 1)),
            "timestep": self.model.opt.timestep,
            "epoch": self.epoch,
            "step": self.step,
            "paused": False,
            "speed": 1.0,
            "plugins": {},
            **catalogue(self.model),
        }

    def frame(self, flags=0, wall_time=None):
        self.step += 1
        now = time.time() if wall_time is None else wall_time
        return self._frames.write(self.data, self.step * 0.01, now, self.epoch, self.step, flags)

    def overlay(self, kind):
        return self._overlays.write(self.data, kind, self.data.time, self.epoch)


class Studio:
    """The page and the other end of its WebSocket."""

    def __init__(self, browser, servers, size=(900, 560), scheme="dark"):
        self.servers = list(servers)
        self.requests = []
        self.foreign = []
        self.errors = []
        self.overlays = set()
        self.acknowledged = self._batch = 0
        self._context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, service_workers="block"
        )
        self.page = self._context.new_page()
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: message.type == "error" and self.errors.append(message.text))
        self.page.route("**/*", self._serve)
        self.page.route_web_socket(lambda url: url.endswith("/socket"), self._connect)
        self.page.goto(ADDRESS)
        self.page.wait_for_function("count => window.mjplug?.app.stage.worlds.size >= count", arg=1, timeout=TIMEOUT)

    def close(self):
        self._context.close()

    def send(self, message):
        self._socket.send(json.dumps(message))

    def send_item(self, kind, server, channel, payload):
        self._batch += 1
        self._socket.send(struct.pack("<BBHIQ", kind, server, channel, self._batch, 0) + payload)

    def show(self, server=0, **arguments):
        """Sends the state of a server and waits until it is drawn."""
        applied = self.stats()["applied"]
        self.send_item(_FRAME, server, 0, self.servers[server].frame(**arguments))
        self._wait("stats.applied > arg", applied)

    def show_overlay(self, kind, label, server=0):
        """Switches an overlay on in the page, sends it when the page requests it, and waits until it is drawn."""
        self.page.get_by_label(label, exact=True).check()
        self.page.wait_for_function("() => true")
        assert kind in self.overlays
        drawn = self.stats()["drawn"]
        self.send_item(_OVERLAY, server, list(KINDS).index(kind), self.servers[server].overlay(kind))
        self._wait("stats.drawn > arg", drawn)

    def hide_overlay(self, label):
        """Switches an overlay off in the page, and waits until the scene is drawn without it."""
        drawn = self.stats()["drawn"]
        self.page.get_by_label(label, exact=True).uncheck()
        self._wait("stats.drawn > arg", drawn)

    def stats(self):
        return self.page.evaluate("window.mjplug.stats()")

    def evaluate(self, code, arg=None):
        """Evaluates JavaScript with `stage` and `world`, the world of the first server."""
        return self.page.evaluate(
            f"arg => {{ const stage = window.mjplug.app.stage; const world = stage.worlds.get(0); return {code}; }}",
            arg,
        )

    def redraw(self, code="null", arg=None):
        """Evaluates JavaScript as `evaluate`, and waits until the scene is drawn again."""
        drawn = self.stats()["drawn"]
        self.evaluate(f"({code}, stage.invalidate())", arg)
        self._wait("stats.drawn > arg", drawn)

    def picture(self):
        """Returns what is drawn on the canvas, shape (height, width, 3), RGB."""
        content = self.page.evaluate(
            """async () => {
                const bytes = new Uint8Array(await (await window.mjplug.app.stage.snapshot()).arrayBuffer());
                return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
            }"""
        )
        return cv2.imdecode(np.frombuffer(base64.b64decode(content), np.uint8), cv2.IMREAD_COLOR_RGB)

    def _wait(self, condition, arg):
        self.page.wait_for_function(
            f"arg => {{ const stats = window.mjplug.stats(); return {condition}; }}", arg=arg, timeout=TIMEOUT
        )

    def _serve(self, route):
        url = route.request.url
        self.requests.append(url)
        if not url.startswith(ADDRESS):
            self.foreign.append(url)
            route.abort()
            return
        path = url[len(ADDRESS) :].partition("?")[0] or "index.html"
        if path.startswith("scene/"):
            (content,) = {s.content for s in self.servers if path.endswith(s.hash)}
            route.fulfill(body=content, content_type="application/octet-stream")
            return
        file = PAGE / path
        route.fulfill(body=file.read_bytes(), content_type=_TYPES.get(file.suffix, "application/octet-stream"))

    def _connect(self, socket):
        self._socket = socket
        socket.on_message(self._receive)
        servers = [{"id": i, "name": s.name, "connected": True} for i, s in enumerate(self.servers)]
        self.send(
            {
                "op": "hello",
                "protocol": 1,
                "version": "0",
                "viewer": "test",
                "read_only": False,
                "servers": servers,
            }
        )

    def _receive(self, text):
        message = json.loads(text)
        if message["op"] == "watch" and message["on"]:
            server = message["server"]
            self.send({"op": "info", "server": server, "info": self.servers[server].info()})
        elif message["op"] == "overlay":
            (self.overlays.add if message["on"] else self.overlays.discard)(message["kind"])
        elif message["op"] == "ack":
            self.acknowledged = message["batch"]
        elif "id" in message:
            self.send({"op": "reply", "id": message["id"], "ok": False, "error": "not in this test"})


__all__ = ["ADDRESS", "PAGE", "PAUSED", "Server", "Studio"]
