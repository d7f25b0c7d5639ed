"""Ends the process if a stop takes too long, and prints what hung.

Three parts can hang. Each one is watched by a part that does not depend on it:

- The physics thread, in Python or in a C call. Python's own signal handlers run on this thread, so they are not enough.
  The C part of Python's signal handling writes each signal's number to a socket (`signal.set_wakeup_fd`), and a thread
  reads it.
- All of Python, in a C call that holds the GIL or at the end of the interpreter. Then only another process can act; see
  `overseer`.
- The output of the last line, if standard error is a full pipe. A separate thread writes it, with a time limit.
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
"""Exit code after a forced stop. It is also the number of a real-time signal; see `Overseer`."""

STOP_TIME = 3.3
"""Time after which a stop is forced [s]. The whole stop takes less than 5 s, even on a busy machine."""

SAME_SIGNAL = 0.5
"""Time within which a repeated signal counts as the same one [s]."""

_OVERSEER_TIME = 4.4
"""Time after which the other process ends this one [s]."""

_LAST_ACTION_TIME = 0.3
"""Time limit for writing the last line, and for closing the session, in a forced stop [s]."""

_HANDLER_TIME = 0.2
"""Time for the signal handler on the main thread to end the process after a second signal [s]."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopWatchdog:
    """Limits the time from the first signal, or from `begin`, to the end of the process.

    Attributes:
        describe: Returns what the physics thread is doing; called in a forced stop.
        on_signal: Called at the first signal, on the watchdog's thread.
        on_forced_stop: Called with the reason in a forced stop, to close the session.
    """

    def __init__(self) -> None:
        self.describe: Callable[[], str] = _unknown
        self.on_signal: Callable[[], None] = _nothing
        self.on_forced_stop: Callable[[str], None] = _nothing_with
        self._deadline: float | None = None
        self._first_signal: float | None = None
        self._reader, self._writer = socket.socketpair()
        self._overseer: Overseer | None = None
        self._lock = threading.Lock()

    def start(self) -> None:
        """Starts watching, until the process ends.

        Python allows signal handling on the main thread only; on another thread, only `begin` starts the time.
        """
        self._reader.setblocking(False)
        self._writer.setblocking(False)
        if threading.current_thread() is threading.main_thread():
            signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        with contextlib.suppress(OSError):
            # Without it, a stop is limited only while Python itself runs.
            self._overseer = Overseer(self._reader, _OVERSEER_TIME, FORCED_STOP)
        threading.Thread(target=self._watch, name="stop watchdog", daemon=True).start()

    def begin(self) -> None:
        """Limits the time until the process ends. May be called on any thread; later calls do nothing."""
        with self._lock:
            if self._deadline is not None:
                return
            self._deadline = monotonic() + STOP_TIME
        if self._overseer is not None:
            self._overseer.begin()
        with contextlib.suppress(OSError):
            # Wakes the thread, which waits without a deadline.
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
        _bounded(lambda: self.on_forced_stop(sentence))
        _bounded(lambda: os.write(2, f"error: {sentence}\n".encode(errors="replace")))
        os._exit(FORCED_STOP)


def _bounded(action: Callable[[], object]) -> None:
    """Runs an action that may hang or fail; returns after at most `_LAST_ACTION_TIME`."""

    def run() -> None:
        with contextlib.suppress(Exception):
            action()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(_LAST_ACTION_TIME)


def _unknown() -> str:
    return "the start of the server"


def _nothing() -> None:
    pass


def _nothing_with(_: str) -> None:
    pass
