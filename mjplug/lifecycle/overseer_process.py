"""The program that `overseer` starts. It imports only the standard library."""

import os
import re
import select
import signal
import socket
import sys
import time
from dataclasses import dataclass

_STEP = 0.1
"""Interval between two checks of a signal that does not stop the server and has not been read yet [s]."""

_DUMP_TIME = 0.3
"""Time for the server to write the tracebacks of its threads [s]."""

_EXIT_TIME = 0.2
"""Time for the server to end after a signal that ends it [s]."""

_GRACE = 0.4
"""Time for a server that has begun to end itself by force, on a busy machine [s]."""

_STOPPING = {signal.SIGINT, signal.SIGTERM}


@dataclass(frozen=True, slots=True)
class Server:
    """The server's process.

    Attributes:
        process: A pidfd, which becomes readable when the server has ended. Unlike a process id, it never refers to
            another process.
        signals: The socket to which the C part of the server's signal handling writes the numbers of signals.
        control: A pipe that contains `s` when the server begins to stop, and `f` when it begins to end by force.
        dump: A pipe that contains the tracebacks of the server's threads after `dump_signal`.
        thread: Python's identifier of the physics thread.
        dump_signal: Signal at which the server writes to `dump`.
        exit_signal: Signal at which the server ends.
    """

    process: int
    signals: socket.socket
    control: int
    dump: int
    thread: int
    dump_signal: int
    exit_signal: int

    def begins_to_stop(self) -> bool:
        """Waits until the server begins to stop; returns False if it has ended."""
        while True:
            ready = select.select([self.process, self.control, self.signals.fileno()], [], [])[0]
            if self.process in ready:
                return False
            if self.control in ready:
                # No byte means that the pipe is closed, so the server has ended.
                return bool(os.read(self.control, 1))
            try:
                # Not removed from the socket: the server reads it if Python runs.
                waiting = self.signals.recv(64, socket.MSG_PEEK | socket.MSG_DONTWAIT)
            except BlockingIOError:
                continue
            if _STOPPING & set(waiting):
                return True
            time.sleep(_STEP)

    def ended(self, within: float) -> bool:
        """Waits at most `within` [s] until the server has ended; returns whether it has."""
        return _readable(self.process, within)

    def ends_itself(self) -> bool:
        """Returns whether the server has begun to end itself by force, which means that its Python runs."""
        return _readable(self.control, 0.0) and b"f" in os.read(self.control, 16)

    def end(self, seconds: float) -> None:
        """Ends the server, and prints where it hung.

        Args:
            seconds: Time since the stop began [s].
        """
        signal.pidfd_send_signal(self.process, self.dump_signal)
        text = b""
        while _readable(self.dump, _DUMP_TIME) and (part := os.read(self.dump, 65536)):
            text += part
        sentence = (
            f"error: the server did not stop within {seconds:g} s, did not end itself either, and was ended; "
            f"{place(text.decode(errors='replace'), self.thread)}\n"
        )
        # Standard error may be a full pipe.
        if select.select([], [2], [], _DUMP_TIME)[1]:
            os.write(2, sentence.encode()[: select.PIPE_BUF])
        # The first signal keeps the exit code, and also ends process 1 of a container, which SIGKILL from inside does
        # not. The second one ends a process that is stopped.
        for number in (self.exit_signal, signal.SIGKILL):
            signal.pidfd_send_signal(self.process, number)
            if self.ended(_EXIT_TIME):
                return


def place(dump: str, thread: int) -> str:
    """Returns where a thread is, from the output of `faulthandler`.

    Args:
        dump: Blocks of lines, one block for each thread, the innermost call first.
        thread: Python's identifier of the thread.
    """
    for block in re.split(r"\n\s*\n", dump):
        head, _, rest = block.strip().partition("\n")
        if f"0x{thread:016x}" in head and rest:
            innermost = rest.partition("\n")[0].strip()
            return f"its physics thread was in: {innermost}"
    return "its Python code had ended, so a library did not end"


def _readable(descriptor: int, within: float) -> bool:
    return bool(select.select([descriptor], [], [], within)[0])


def main(pid: int, seconds: float, signals: int, control: int, dump: int, *rest: int) -> None:
    """Ends the server if it takes too long to stop; returns when the server has ended.

    Args:
        pid: The process id of the server.
        seconds: Time from the beginning of a stop to the forced end [s].
        signals: As in `Server`.
        control: As in `Server`.
        dump: As in `Server`.
        rest: `thread`, `dump_signal`, `exit_signal`.
    """
    # A program that stops the server may also send the signal to this process, which must outlast the server.
    for number in (*_STOPPING, signal.SIGHUP, signal.SIGTTOU):
        signal.signal(number, signal.SIG_IGN)
    process = os.pidfd_open(pid)
    if os.getppid() != pid:
        # The server has ended, and another process may have its process id.
        return
    server = Server(process, socket.socket(fileno=signals), control, dump, *rest)
    if not server.begins_to_stop() or server.ended(seconds):
        return
    if not (server.ends_itself() and server.ended(_GRACE)):
        server.end(seconds)


if __name__ == "__main__":
    pid, seconds, *rest = sys.argv[1:]
    try:
        main(int(pid), float(seconds), *map(int, rest))
    except ProcessLookupError:
        # The server has ended.
        sys.exit(0)
