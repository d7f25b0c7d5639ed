"""Limits of TCP connections that the `websockets` library does not have."""

import asyncio
from dataclasses import dataclass

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State


@dataclass(slots=True)
class ConnectionLimits:
    """The limits of all connections together, and their number.

    Attributes:
        count: Number of TCP connections.
        max_count: Maximum number of TCP connections, including those that load files of the page.
        patience: Time for a client to send its request, and interval in which it must read a part of the response [s].
        max_echo: Maximum size of answers to pings that a client does not read [bytes].
    """

    count: int = 0
    max_count: int = 256
    patience: float = 10.0
    max_echo: int = 1 << 20


def limited(limits: ConnectionLimits) -> type[ServerConnection]:
    """Returns a class of connections with limits."""

    class Connection(ServerConnection):
        """A connection that ends if its client is too slow, or sends pings without reading the answers."""

        _unread = 0
        _echoed = 0

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(transport)
            limits.count += 1
            if limits.count > limits.max_count:
                self.transport.abort()
            else:
                self._timer = self.loop.call_later(limits.patience, self._check)

        def connection_lost(self, exc: Exception | None) -> None:
            limits.count -= 1
            super().connection_lost(exc)

        def data_received(self, data: bytes) -> None:
            before = self.transport.get_write_buffer_size()
            super().data_received(data)
            after = self.transport.get_write_buffer_size()
            # Only the answers to pings are written here, and without flow control.
            self._echoed = self._echoed + max(0, after - before) if after else 0
            if self._echoed > limits.max_echo:
                self.transport.abort()

        def _check(self) -> None:
            """Ends a connection without a request, or whose client reads nothing of the response."""
            if self.protocol.state is State.OPEN or self.transport.is_closing():
                # Pings of the library find a WebSocket whose other end is gone.
                return
            unread = self.transport.get_write_buffer_size()
            stuck = self.response is not None and 0 < self._unread <= unread
            if self.request is None or stuck:
                self.transport.abort()
                return
            self._unread = unread
            self._timer = self.loop.call_later(limits.patience, self._check)

    return Connection
