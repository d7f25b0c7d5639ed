"""Sends answers on a thread of its own: a client that stops reading may block that one, but not physics."""

import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue

import zenoh

from mjplug.log_scope import bound
from mjplug.wire.rejections import Rejections

_LOG = logging.getLogger(__name__)

_DRAIN_TIMEOUT = 2.0
"""How long `close` waits for the last answers [s]; longer than Zenoh waits for a client that does not read."""

Send = Callable[[], None]


class Replies:
    """A queue of answers and the thread that sends them, in order.

    Attributes:
        lost: The answers that found no client or no session any more.
    """

    def __init__(self) -> None:
        self.lost = Rejections("the answer to a request could not be sent", logging.DEBUG)
        self._queue: SimpleQueue[Send | None] = SimpleQueue()
        # A daemon, so that a process that forgets to close can still end.
        self._thread = threading.Thread(target=bound(self._run), name="mjplug-replies", daemon=True)
        self._thread.start()

    def post(self, send: Send) -> None:
        """Queues an answer; from any thread."""
        self._queue.put(send)

    def close(self) -> None:
        """Waits until what was queued has been sent, and ends the thread; a second call does nothing."""
        self._queue.put(None)
        self._thread.join(_DRAIN_TIMEOUT)

    def _run(self) -> None:
        while send := self._queue.get():
            try:
                send()
            except zenoh.ZError as error:
                # The client or the session is gone, which nobody here can change.
                self.lost.add(str(error))
            except Exception:
                _LOG.exception("an answer could not be sent")
