"""Sends replies on a separate thread, so that a client that stops reading does not block physics.

While the simulation is paused and no client has requested steps, there are no steps to delay, and the physics thread
sends short replies itself.
"""

import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue

import zenoh

from mjplug.log_scope import bound
from mjplug.wire.rejections import Rejections

_LOG = logging.getLogger(__name__)

_DRAIN_TIMEOUT = 2.0
"""Maximum time for which `close` waits for the last replies [s]; longer than Zenoh waits for a client that does not
read."""

MAX_DIRECT = 64 * 1024
"""Maximum size of a reply that a thread sends itself [bytes]: a batch of Zenoh."""

Send = Callable[[], None]


class Replies:
    """A queue of replies and the thread that sends them, in order.

    Attributes:
        may_wait: Returns whether the calling thread may wait for a client that does not read. Then it sends short
            replies itself, which is faster.
        lost: Replies that could not be sent because the client or the session was closed.
    """

    def __init__(self) -> None:
        self.lost = Rejections("the reply to a request could not be sent", logging.DEBUG)
        self.may_wait: Callable[[], bool] = _never
        self._queue: SimpleQueue[Send | None] = SimpleQueue()
        # A daemon thread, so that the process can end without `close`.
        self._thread = threading.Thread(target=bound(self._run), name="mjplug-replies", daemon=True)
        self._thread.start()

    def post(self, send: Send, size: int = 0) -> None:
        """Queues a reply, or sends it at once. May be called from any thread.

        Args:
            send: Sends the reply.
            size: Size of the reply [bytes].
        """
        if size <= MAX_DIRECT and self.may_wait():
            self._send(send)
        else:
            self._queue.put(send)

    def close(self) -> None:
        """Waits until the queued replies have been sent, and stops the thread; a second call does nothing."""
        self._queue.put(None)
        self._thread.join(_DRAIN_TIMEOUT)

    def _run(self) -> None:
        while send := self._queue.get():
            self._send(send)

    def _send(self, send: Send) -> None:
        try:
            send()
        except zenoh.ZError as error:
            # The client or the session was closed, which is no failure of the server.
            self.lost.add(str(error))
        except Exception:
            _LOG.exception("sending a reply failed")


def _never() -> bool:
    return False
