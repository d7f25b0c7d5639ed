"""The program of the process that `overseer` starts. It imports nothing but the standard library."""

import os
import re
import select
import signal
import sys
import time

_STEP = 0.1
"""Pause between two looks at a signal's number that nobody has taken [s]."""

_DUMP_TIME = 0.3
"""Time for the server to write down where its threads are [s]."""

_EXIT_TIME = 0.2
"""Time for the server to end by itself after the signal for it [s]."""


class Overseer:
    """Waits for a stop, and ends the server if it takes too long.

    Args:
        signals: Descriptor of the socket to which the numbers of signals are written.
        control: Descriptor that gives a byte when the server is about to end.
        dump: Descriptor that gives where the threads of the server are, after `dump_signal`.
        pid: The server.
        thread: Its physics thread, as Python numbers threads.
        seconds: Time from the beginning of a stop to the forced end [s].
        dump_signal: Signal at which the server writes to `dump`.
        exit_signal: Signal at which it ends.
    """

    def __init__(
        self,
        signals: int,
        control: int,
        dump: int,
        pid: int,
        thread: int,
        seconds: float,
        dump_signal: int,
        exit_signal: int,
    ) -> None:
        self._signals, self._control, self._dump = signals, control, dump
        self._pid, self._thread = pid, thread
        self._seconds = seconds
        self._dump_signal, self._exit_signal = dump_signal, exit_signal
        self._server = os.pidfd_open(pid)
        self._deadline = float("inf")
        self._begun = False

    def run(self) -> None:
        """Returns when the server has ended."""
        while not self._ended(0.0):
            now = time.monotonic()
            if now >= self._deadline:
                self._end_server()
                return
            self._look(now)

    def _look(self, now: float) -> None:
        """Waits for news, and sets or clears the deadline."""
        waiting = self._poll(self._signals, 0.0)
        if not self._begun:
            # A number that the server has taken after all is the server's business.
            self._deadline = min(self._deadline, now + self._seconds) if waiting else float("inf")
        timeout = None if self._deadline == float("inf") else max(0.0, self._deadline - now)
        watched = [self._server] if self._begun else [self._server, self._control]
        if waiting:
            timeout = min(_STEP, timeout or 0.0)
        elif not self._begun:
            watched.append(self._signals)
        ready = select.select(watched, [], [], timeout)[0]
        if self._control in ready and os.read(self._control, 1):
            self._begun = True
            self._deadline = min(self._deadline, time.monotonic() + self._seconds)

    def _end_server(self) -> None:
        os.kill(self._pid, self._dump_signal)
        text = b""
        while self._poll(self._dump, _DUMP_TIME):
            text += os.read(self._dump, 65536)
        sentence = (
            f"error: the server did not stop within {self._seconds:g} s and was ended: Python itself stood still, "
            f"{place(text.decode(errors='replace'), self._thread)}\n"
        )
        # Standard error may be a pipe that nobody reads.
        if select.select([], [2], [], _DUMP_TIME)[1]:
            os.write(2, sentence.encode()[: select.PIPE_BUF])
        for number in (self._exit_signal, signal.SIGKILL):
            os.kill(self._pid, number)
            if self._ended(_EXIT_TIME):
                return

    def _ended(self, within: float) -> bool:
        return self._poll(self._server, within)

    def _poll(self, descriptor: int, within: float) -> bool:
        return bool(select.select([descriptor], [], [], within)[0])


def place(dump: str, thread: int) -> str:
    """Returns where a thread is, by what Python's faulthandler has written.

    Args:
        dump: Blocks of lines, one block for each thread, its innermost call first.
        thread: The thread's number.
    """
    for block in re.split(r"\n\s*\n", dump):
        head, _, rest = block.strip().partition("\n")
        if f"0x{thread:016x}" in head and rest:
            innermost = rest.partition("\n")[0].strip()
            return f"with the GIL kept in: {innermost}"
    return "after its last line of Python: a library did not end"


if __name__ == "__main__":
    signals, control, dump, pid, thread, seconds, dump_signal, exit_signal = sys.argv[1:]
    try:
        overseer = Overseer(
            int(signals),
            int(control),
            int(dump),
            int(pid),
            int(thread),
            float(seconds),
            int(dump_signal),
            int(exit_signal),
        )
        overseer.run()
    except ProcessLookupError:
        # The server has ended meanwhile.
        sys.exit(0)
