"""A terminal that delivers each key at once, and signals between two keys."""

import os
import select
import signal
import sys
import termios
import tty
from types import FrameType, TracebackType

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


class KeyTerminal:
    """The terminal at standard input, without line editing and echo inside a `with` block.

    Inside the block, signals run no code. They are reported between two keys, so that the caller can act at a known
    point. Every end of the block restores the terminal and the handlers.
    """

    def __init__(self) -> None:
        self._input = sys.stdin.fileno()
        self._wake, self._woken = -1, -1

    def __enter__(self) -> "KeyTerminal":
        self._settings = termios.tcgetattr(self._input)
        self._wake, self._woken = os.pipe()
        for end in (self._wake, self._woken):
            os.set_blocking(end, False)
        self._wakeup = signal.set_wakeup_fd(self._woken)
        self._handlers = {number: signal.signal(number, _ignore) for number in (*_ENDING, signal.SIGTSTP)}
        tty.setcbreak(self._input)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()
        signal.set_wakeup_fd(self._wakeup)
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        os.close(self._wake)
        os.close(self._woken)

    def read(self, timeout: float | None) -> tuple[str, frozenset[signal.Signals]]:
        """Waits for keys or signals.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Returns:
            What the terminal has sent, and the signals that have arrived; both are empty after the timeout. If the
            terminal is gone, SIGHUP is among the signals.
        """
        ready, _, _ = select.select([self._input, self._wake], [], [], timeout)
        signals = set()
        if self._wake in ready:
            signals = {signal.Signals(number) for number in os.read(self._wake, 64)}
        text = b""
        if self._input in ready:
            try:
                text = os.read(self._input, 1024)
            except OSError:
                signals.add(signal.SIGHUP)
            else:
                if not text:
                    signals.add(signal.SIGHUP)
        return text.decode(errors="replace"), frozenset(signals)

    def suspend(self) -> None:
        """Restores the terminal and stops the process, as Ctrl-Z does; continues with SIGCONT."""
        self._restore()
        os.kill(os.getpid(), signal.SIGSTOP)
        tty.setcbreak(self._input)

    def _restore(self) -> None:
        # If the terminal is gone, there is nothing to restore.
        try:
            termios.tcsetattr(self._input, termios.TCSADRAIN, self._settings)
        except termios.error:
            return


def _ignore(number: int, frame: FrameType | None) -> None:
    """Does nothing; Python then writes the number to the file of `set_wakeup_fd`."""
