"""Sends replies on a separate thread, so that a client that stops reading does not block physics."""

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

Send = Callable[[], None]


class Replies:
    """A queue of replies and the thread that sends them, in order.

    Attributes:
        lost: Replies that could not be sent because the client or the session was closed.
    """

    def __init__(self) -> None:
        self.lost = Rejections("the reply to a request could not be sent", logging.DEBUG)
        self._queue: SimpleQueue[Send | None] = SimpleQueue()
        # A daemon thread, so that the process can end without `close`.
        self._thread = threading.Thread(target=bound(self._run), name="mjplug-replies", daemon=True)
        self._thread.start()

    def post(self, send: Send) -> None:
        """Queues a reply. May be called from any thread."""
        self._queue.put(send)

    def close(self) -> None:
        """Waits until the queued replies have been sent, and stops the thread; a second call does nothing."""
        self._queue.put(None)
        self._thread.join(_DRAIN_TIMEOUT)

    def _run(self) -> None:
        while send := self._queue.get():
            try:
                send()
            except zenoh.ZError as error:
                # The client or the session was closed, which is no failure of the server.
                self.lost.add(str(error))
            except Exception:
                _LOG.exception("sending a reply failed")
