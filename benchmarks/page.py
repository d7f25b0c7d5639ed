"""A page of `mjplug view` that draws nothing: it takes what the relay sends, and acknowledges it at once."""

import json
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

_HEADER = struct.Struct("<BBHIQ")
_FRAME = 1


class Page:
    """Counts the frames of one server. A thread receives.

    Attributes:
        frames: Number of frames so far.
        frame_bytes: Length of the newest frame, without the header [bytes].
        viewer: The relay's name for this page.
    """

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.frames = self.frame_bytes = 0
        hello = message = json.loads(socket.recv(10.0))
        self.viewer = hello["viewer"]
        while not any(server["connected"] for server in message.get("servers", [])):
            message = json.loads(socket.recv(10.0))
        self._first = threading.Event()
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()
        self.send(op="watch", server=0, on=True)
        assert self._first.wait(30.0), "no frame within 30 s"

    def send(self, **message: Any) -> None:
        """Sends a message to the relay."""
        self._socket.send(json.dumps(message))

    def _receive(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._socket:
                if isinstance(message, str):
                    continue
                kind, _, _, batch, _ = _HEADER.unpack_from(message)
                if kind == _FRAME:
                    self.frames += 1
                    self.frame_bytes = len(message) - _HEADER.size
                    self._first.set()
                self.send(op="ack", batch=batch)


@contextmanager
def page(url: str) -> Iterator[Page]:
    """Opens a page at a URL such as `http://127.0.0.1:8080/`."""
    with connect(url.replace("http", "ws", 1) + "socket", origin=url.rstrip("/"), max_size=None) as socket:  # type: ignore[arg-type]
        yield Page(socket)
