"""One page: reads its requests, and sends what waits for it."""

import asyncio
import contextlib
import json
import logging
import secrets
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from mjplug.client.errors import ClientError
from mjplug.errors import MjplugError
from mjplug.view.channels import Channels
from mjplug.view.commands import READ_ONLY, Calls, Publishing
from mjplug.view.dragging import Dragging
from mjplug.view.images import Encoder, ImageChannel
from mjplug.view.network import Network
from mjplug.view.outbox import Outbox
from mjplug.view.remote_server import Server
from mjplug.view.streams import Streams
from mjplug.view.values import shown

_log = logging.getLogger(__name__)

MAX_TEXTS = 1000
"""Maximum number of text messages that wait for the page; a page that does not read them is disconnected."""

MAX_TEXT_BYTES = 16 << 20
"""Maximum total size of these messages [characters]; one message is always kept."""

MAX_RATE = 1000
"""Maximum number of messages of a page per second; the rest waits, which slows down only this page."""

SUSPEND_AFTER = 5.0
"""Time without an acknowledgement, while something waits, after which nothing is subscribed to for the page [s]."""


class Viewer:
    """The connection of one page. Event loop only.

    Args:
        connection: The WebSocket.
        network: The network; None if no server has been found yet.
        read_only: Whether the page may only look.
        encoder: Encodes camera images.
    """

    def __init__(
        self,
        connection: ServerConnection,
        network: Network | None,
        read_only: bool,
        encoder: Encoder,
    ) -> None:
        self.name = f"view-{secrets.token_hex(6)}"
        self._connection = connection
        self._read_only = read_only
        self._encoder = encoder
        self._texts: deque[str] = deque()
        self._text_size = 0
        self._wake = asyncio.Event()
        self._outbox = Outbox(self._wake.set)
        self._tasks: set[asyncio.Task[None]] = set()
        self._blocked_since: float | None = None
        self._suspended = False
        self._network: Network | None = None
        if network is not None:
            self.connect(network)

    def connect(self, network: Network) -> None:
        """Lets the page use the network."""
        self._network = network
        self._channels = Channels(network, self._outbox, self._image)
        self._streams = Streams(network, self._outbox, self)
        self._calls = Calls(network, self._read_only)
        self._publishing = Publishing(network)
        self._dragging = Dragging(network, self.name)

    async def run(self, version: str) -> None:
        """Serves the page until it disconnects."""
        servers = [] if self._network is None else self._network.servers.describe()
        self.send(op="hello", protocol=1, version=version, viewer=self.name, read_only=self._read_only, servers=servers)
        sender = asyncio.create_task(self._send())
        try:
            await self._read()
        finally:
            sender.cancel()
            for task in self._tasks:
                task.cancel()
            self._close()

    def send(self, **message: Any) -> None:
        """Sends a text message soon."""
        self._send_text(json.dumps(message, separators=(",", ":")))

    def end(self) -> None:
        """Stops what the page has started, because the relay ends."""
        if self._network is not None:
            self._publishing.close()
            self._dragging.close()

    def described(self, server: Server, info: str) -> None:
        """Sends the description of a server."""
        self._send_text(f'{{"op":"info","server":{server.id},"info":{info}}}')

    def failed(self, reason: str) -> None:
        """Sends the reason why a server cannot be shown."""
        self.send(op="error", error=reason)

    def check(self, now: float) -> None:
        """Ends all subscriptions of a page that has not acknowledged for long; called about once a second."""
        if not self._outbox.blocked:
            self._blocked_since = None
        elif self._blocked_since is None:
            self._blocked_since = now
        elif now - self._blocked_since >= SUSPEND_AFTER and not self._suspended:
            self._suspended = True
            self._streams.suspend()
            self._channels.suspend()

    def _image(self, number: int, type: str) -> ImageChannel:
        return ImageChannel(number, type, self._outbox, self._encoder, self.failed)

    def _resume(self) -> None:
        self._suspended = False
        self._streams.resume()
        self._channels.resume()

    def _send_text(self, text: str) -> None:
        self._texts.append(text)
        self._text_size += len(text)
        if len(self._texts) > MAX_TEXTS or (self._text_size > MAX_TEXT_BYTES and len(self._texts) > 1):
            _log.warning("a page does not read its messages, and was disconnected")
            self._connection.transport.abort()
            self._texts.clear()
            self._text_size = 0
        self._wake.set()

    async def _send(self) -> None:
        connection = self._connection
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._texts:
                    text = self._texts.popleft()
                    self._text_size -= len(text)
                    await connection.send(text)
                for item in self._outbox.take():
                    await connection.send(item)

    async def _read(self) -> None:
        clock = asyncio.get_running_loop().time
        began, count = clock(), 0
        with contextlib.suppress(ConnectionClosed):
            async for message in self._connection:
                await self._handle(message)
                count += 1
                if count >= MAX_RATE:
                    await asyncio.sleep(max(0.0, began + 1.0 - clock()))
                    began, count = clock(), 0

    async def _handle(self, text: str | bytes) -> None:
        try:
            message = json.loads(text) if isinstance(text, str) else None
        except (ValueError, RecursionError) as error:
            self.failed(f"the message is not JSON: {error}")
            return
        if not isinstance(message, dict):
            self.failed("the message is not a JSON object in text")
            return
        operation = message.get("op")
        if operation == "ack":
            self._acknowledge(message)
            return
        handler = _OPERATIONS.get(operation) if isinstance(operation, str) else None
        if handler is None:
            allowed = ", ".join(("ack", *_OPERATIONS))
            self._reply(message, f"op is {shown(operation)}; it must be one of: {allowed}")
        elif self._network is None:
            self._reply(message, "no server has been found yet")
        elif operation in _LONG:
            if len(self._tasks) >= _MAX_TASKS:
                self._reply(message, f"{_MAX_TASKS} requests are waiting, which is the maximum; try again later")
                return
            task = asyncio.create_task(self._perform(handler, message))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        else:
            await self._perform(handler, message)

    async def _perform(self, handler: "_Handler", message: dict[str, Any]) -> None:
        try:
            response = await handler(self, message)
        except MjplugError as error:
            self._reply(message, str(error))
        except Exception as error:
            _log.exception("a request of a page failed")
            self._reply(message, f"the view failed: {error!r}")
        else:
            if "id" in message:
                self.send(op="reply", id=message["id"], ok=True, response={} if response is None else response)

    def _reply(self, message: dict[str, Any], error: str) -> None:
        if "id" in message:
            self.send(op="reply", id=message["id"], ok=False, error=error)
        else:
            self.failed(error)

    def _acknowledge(self, message: dict[str, Any]) -> None:
        batch = message.get("batch")
        if isinstance(batch, bool) or not isinstance(batch, int) or batch < 0:
            self._reply(message, f"batch is {shown(batch)}; it must be the number of a batch")
            return
        self._outbox.acknowledge(batch)
        self._blocked_since = None
        if self._suspended:
            self._resume()
        if "id" in message:
            self.send(op="reply", id=message["id"], ok=True, response={})

    async def _watch(self, message: dict[str, Any]) -> None:
        self._streams.watch(message.get("server"), _flag(message))

    async def _overlay(self, message: dict[str, Any]) -> None:
        self._streams.overlay(message.get("server"), message.get("kind"), _flag(message))

    async def _topics(self, message: dict[str, Any]) -> dict[str, Any]:
        assert self._network is not None
        return await self._network.servers.listing()

    async def _subscribe(self, message: dict[str, Any]) -> dict[str, Any]:
        return await self._channels.subscribe(message.get("topic"), message.get("mode"), message.get("server"))

    async def _unsubscribe(self, message: dict[str, Any]) -> None:
        self._channels.unsubscribe(message.get("channel"))

    async def _definition(self, message: dict[str, Any]) -> dict[str, str]:
        type = message.get("type")
        if not isinstance(type, str):
            raise ClientError(f"type is {shown(type)}; it must be a string such as geometry_msgs/msg/Twist")
        assert self._network is not None
        return await self._network.definitions(type)

    async def _call(self, message: dict[str, Any]) -> Any:
        return await self._calls.call(message.get("service"), message.get("request"), message.get("server"))

    async def _publish(self, message: dict[str, Any]) -> None:
        if self._read_only:
            raise ClientError(f"publishing is refused: {READ_ONLY}")
        await self._publishing.publish(message)

    async def _drag(self, message: dict[str, Any]) -> None:
        if self._read_only:
            raise ClientError(f"dragging is refused: {READ_ONLY}")
        await self._dragging.drag(message)

    def _close(self) -> None:
        if self._network is None:
            return
        self._publishing.close()
        self._dragging.close()
        self._channels.close()
        self._streams.close()


_Handler = Callable[[Viewer, dict[str, Any]], Awaitable[Any]]

_OPERATIONS: dict[str, _Handler] = {
    "watch": Viewer._watch,
    "overlay": Viewer._overlay,
    "topics": Viewer._topics,
    "subscribe": Viewer._subscribe,
    "unsubscribe": Viewer._unsubscribe,
    "definition": Viewer._definition,
    "call": Viewer._call,
    "publish": Viewer._publish,
    "drag": Viewer._drag,
}

_LONG = ("call", "topics", "subscribe", "definition")
"""Operations that do not delay the requests that follow."""

_MAX_TASKS = 100
"""Maximum number of such operations of a page at the same time."""


def _flag(message: dict[str, Any]) -> bool:
    on = message.get("on", True)
    if not isinstance(on, bool):
        raise ClientError(f"on is {shown(on)}; it must be true or false")
    return on
