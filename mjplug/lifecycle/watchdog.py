"""Ends the process when a stop takes too long, and says what hung.

Three things can hang, and each needs a watcher that does not need it:

- The physics thread, in Python or in a C call. Python's own signal handlers run on this thread, so they are not enough.
  The C part of Python's signal handling writes each signal's number to a socket (`signal.set_wakeup_fd`), and a thread
  reads it.
- All of Python: a C call that keeps the GIL, or the end of the interpreter. Then only another process can act; see
  `overseer`.
- The writing of the last line, when nobody reads standard error. It gets its own thread and a bounded time.
"""

import contextlib
import os
import select
import signal
import socket
import threading
from collections.abc import Callable
from time import monotonic, sleep

from mjplug.lifecycle.overseer import Overseer

FORCED_STOP = 40
"""Exit code after a forced stop. It is a real-time signal's number too; see `Overseer`."""

STOP_TIME = 3.3
"""Time after which a stop is forced [s]. With the farewell and a busy machine, the whole stays below 5 s."""

SAME_SIGNAL = 0.5
"""Time within which a second signal does not count as one [s]."""

_OVERSEER_TIME = 4.4
"""Time after which the other process ends this one [s]."""

_FAREWELL_TIME = 0.3
"""Time for the last line, and for leaving the network, when a stop is forced [s]."""

_HANDLER_TIME = 0.2
"""Time that the signal handler on the main thread gets to end the process after a second signal [s]."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopWatchdog:
    """Bounds the time from the first signal, or from `begin`, to the end of the process.

    Attributes:
        describe: Returns what the physics thread is doing; called when a stop is forced.
        on_signal: Called at the first signal, on the watchdog's thread.
        farewell: Called with the reason when a stop is forced, to leave the network.
    """

    def __init__(self) -> None:
        self.describe: Callable[[], str] = _unknown
        self.on_signal: Callable[[], None] = _nothing
        self.farewell: Callable[[str], None] = _nothing_with
        self._deadline: float | None = None
        self._first_signal: float | None = None
        self._reader, self._writer = socket.socketpair()
        self._overseer: Overseer | None = None
        self._lock = threading.Lock()

    def start(self) -> None:
        """Begins to watch, until the process ends.

        On another thread than the main one, Python allows no handling of signals; then only `begin` starts the time.
        """
        self._reader.setblocking(False)
        self._writer.setblocking(False)
        if threading.current_thread() is threading.main_thread():
            signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        with contextlib.suppress(OSError):
            # Without one, a stop is bounded as long as Python itself runs.
            self._overseer = Overseer(self._reader, _OVERSEER_TIME, FORCED_STOP)
        threading.Thread(target=self._watch, name="stop watchdog", daemon=True).start()

    def begin(self) -> None:
        """Says that the process is about to end, and bounds the time until then. Any thread; later calls do nothing."""
        with self._lock:
            if self._deadline is not None:
                return
            self._deadline = monotonic() + STOP_TIME
        if self._overseer is not None:
            self._overseer.begin()
        with contextlib.suppress(OSError):
            # Wakes the thread, which waits without a deadline until now.
            self._writer.send(b"\0")

    def _watch(self) -> None:
        while True:
            deadline = self._deadline
            timeout = None if deadline is None else max(0.0, deadline - monotonic())
            if select.select([self._reader], [], [], timeout)[0]:
                for number in self._reader.recv(64):
                    if number in _SIGNALS:
                        self._signalled(number)
            elif deadline is not None and monotonic() >= deadline:
                self._force()

    def _signalled(self, number: int) -> None:
        now = monotonic()
        if self._first_signal is None:
            self._first_signal = now
            self.begin()
            self.on_signal()
        elif now - self._first_signal > SAME_SIGNAL:
            # The main thread, if it runs, ends the process by the signal itself.
            sleep(_HANDLER_TIME)
            os._exit(128 + number)

    def _force(self) -> None:
        if self._overseer is not None:
            self._overseer.forcing()
        try:
            reason = self.describe()
        except Exception as error:
            reason = f"an unknown part of the server ({error!r})"
        sentence = f"the server did not stop within {STOP_TIME:g} s and was ended: {reason} did not return"
        _bounded(lambda: self.farewell(sentence))
        _bounded(lambda: os.write(2, f"error: {sentence}\n".encode(errors="replace")))
        os._exit(FORCED_STOP)


def _bounded(action: Callable[[], object]) -> None:
    """Runs an action that may hang or fail, and goes on after a bounded time."""

    def run() -> None:
        with contextlib.suppress(Exception):
            action()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(_FAREWELL_TIME)


def _unknown() -> str:
    return "the start of the server"


def _nothing() -> None:
    pass


def _nothing_with(_: str) -> None:
    pass
