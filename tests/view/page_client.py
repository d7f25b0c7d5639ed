"""A page without a browser: a WebSocket client in Python."""

import json
import struct
import time
from contextlib import ExitStack
from dataclasses import dataclass

from waits import TIMEOUT
from websockets.sync.client import connect

FRAME, OVERLAY, SAMPLES, IMAGE = 1, 2, 3, 4


@dataclass
class Item:
    kind: int
    server: int
    channel: int
    batch: int
    payload: bytes

    @property
    def samples(self):
        """Returns (CDR, lost) of each sample."""
        found, at = [], 0
        while at < len(self.payload):
            length, lost = struct.unpack_from("<II", self.payload, at)
            found.append((self.payload[at + 8 : at + 8 + length], lost))
            at += 8 + length + (-length & 7)
        return found


class Page:
    """A connection to a relay.

    Attributes:
        hello: The first message.
        texts: Text messages that no call has taken.
        items: Binary items that no call has taken.
    """

    def __init__(self, url, acknowledges=True, **options):
        options.setdefault("compression", None)
        self._opened = ExitStack()
        socket = f"{url.replace('http', 'ws', 1)}socket"
        self.socket = self._opened.enter_context(connect(socket, max_size=None, **options))
        self.texts, self.items = [], []
        self._acknowledges = acknowledges
        self._id = 0
        self.hello = self.text("hello")

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def ask(self, **message):
        """Sends a request and returns its reply."""
        self._id += 1
        self.send(id=self._id, **message)
        return self._take(self.texts, lambda text: text.get("id") == self._id)

    def do(self, **message):
        """Sends a request that succeeds, and returns the response."""
        reply = self.ask(**message)
        assert reply["ok"], reply
        return reply["response"]

    def refused(self, **message):
        """Sends a request that is refused, and returns the reason."""
        reply = self.ask(**message)
        assert not reply["ok"], reply
        return reply["error"]

    def text(self, op, where=lambda text: True):
        """Returns the next text message of a kind."""
        return self._take(self.texts, lambda text: text["op"] == op and where(text))

    def item(self, kind, where=lambda item: True):
        """Returns the next item of a kind."""
        return self._take(self.items, lambda item: item.kind == kind and where(item))

    def acknowledge(self, batch):
        self.send(op="ack", batch=batch)

    def nothing(self, seconds=0.3):
        """Reads for some time, and returns whether nothing came."""
        before, until = len(self.texts) + len(self.items), time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            try:
                self._read(left)
            except TimeoutError:
                break
        return len(self.texts) + len(self.items) == before

    def close(self):
        self._opened.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _take(self, queue, wanted):
        until = time.monotonic() + TIMEOUT
        while True:
            for each in queue:
                if wanted(each):
                    queue.remove(each)
                    return each
            try:
                self._read(max(0.0, until - time.monotonic()))
            except TimeoutError:
                raise AssertionError(f"not received; there are {self.texts} and {len(self.items)} items") from None

    def _read(self, timeout):
        data = self.socket.recv(timeout)
        if isinstance(data, str):
            self.texts.append(json.loads(data))
            return
        item = Item(*struct.unpack_from("<BBHI", data), data[16:])
        assert data[8:16] == bytes(8)
        self.items.append(item)
        if self._acknowledges:
            self.acknowledge(item.batch)
