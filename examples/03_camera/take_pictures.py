"""Requests an image and saves it, then saves an image of the streaming camera; with Zenoh, JSON, numpy and OpenCV.

Usage: python take_pictures.py [ENDPOINT [FOLDER]]      (default tcp/127.0.0.1:7447, the current folder)
"""

import json
import queue
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import zenoh

from mjplug_schemas.sensor_msgs import CameraInfo, Image

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"]))
folder = Path(sys.argv[2] if len(sys.argv) > 2 else ".")

IMAGE_TIMEOUT = 30.0
"""How long to wait for an image [s]; with software rendering, `quality: full` is slow."""

ATTEMPTS = 5
"""How often an image is requested."""


def main() -> int:
    """Saves three files; returns 0 if all images arrived."""
    with zenoh.open(config) as session:
        inbox: dict[str, queue.Queue[bytes]] = {}
        for topic in ("overview/color", "overview/depth", "overview/camera_info", "wrist/color/compressed"):
            inbox[topic] = queue.Queue()
            session.declare_subscriber(f"cameras/{topic}", lambda s, q=inbox[topic]: q.put(s.payload.to_bytes()))

        picture = None
        for _ in range(ATTEMPTS):
            answer = ask(session, "cameras/overview/trigger")
            print("trigger:", answer["message"], flush=True)
            # If the request was refused, the message says why: the renderer may still be starting.
            if not answer["success"]:
                continue
            # Zenoh may drop an image on a busy link; then another one is requested.
            if picture := received(inbox["overview/color"], inbox["overview/depth"], inbox["overview/camera_info"]):
                break
        if picture is None:
            print("no image arrived", file=sys.stderr)
            return 1
        image, depth, info = Image.from_cdr(picture[0]), Image.from_cdr(picture[1]), CameraInfo.from_cdr(picture[2])

        rgb = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
        metres = np.frombuffer(depth.data, np.float32).reshape(depth.height, depth.width)
        cv2.imwrite(str(folder / "colour.png"), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
        cv2.imwrite(str(folder / "depth.png"), painted(metres))
        print(f"colour.png and depth.png: {image.width}x{image.height}, {image.header.frame_id}")

        middle = float(metres[depth.height // 2, depth.width // 2])
        print(f"in the middle, {middle:.3f} m away; nearest {np.nanmin(metres):.3f} m; fx = {info.k[0]:.1f} pixels")

        # A CompressedImage in CDR is header, format and data; the JPEG begins with ff d8 ff.
        compressed = inbox["wrist/color/compressed"].get(timeout=IMAGE_TIMEOUT)
        (folder / "wrist.jpg").write_bytes(compressed[compressed.index(b"\xff\xd8\xff") :])
        print("wrist.jpg: the JPEG of the server, unchanged")
    return 0


def received(*inboxes: "queue.Queue[bytes]") -> list[bytes] | None:
    """Returns the next message of each topic, or None if one of them does not arrive."""
    try:
        return [inbox.get(timeout=IMAGE_TIMEOUT / ATTEMPTS) for inbox in inboxes]
    except queue.Empty:
        return None


def painted(metres: np.ndarray) -> np.ndarray:
    """Returns a colour image of a depth image [m]: near is red, far is blue, infinite is black."""
    something = np.isfinite(metres)
    near, far = np.percentile(metres[something], (0.5, 99.5))
    scaled = np.clip((far - metres) / (far - near), 0, 1, where=something, out=np.zeros_like(metres))
    colours = cv2.applyColorMap((scaled * 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    colours[~something] = 0
    return colours


def ask(session: zenoh.Session, service: str) -> dict[str, Any]:
    """Calls a service with an empty request and returns the response."""
    for reply in session.get(service, payload="{}", encoding=zenoh.Encoding.APPLICATION_JSON, timeout=IMAGE_TIMEOUT):
        if reply.ok is not None:
            return json.loads(reply.ok.payload.to_bytes())
        return {"success": False, "message": reply.err.payload.to_string()}
    return {"success": False, "message": f"no server answers at {service}"}


if __name__ == "__main__":
    sys.exit(main())
