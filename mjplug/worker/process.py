"""One worker process as the server sees it: started, talked to, ended."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import IO, Any

from mjplug.work import Job
from mjplug.worker.messages import Setup, pack, read, unpack, write

_DYING = 1.0
"""How long a process may take to end after its last word [s]."""


class WorkerProcess:
    """A running `python -m mjplug.worker`. Started by the thread that reads from it: with that thread, it dies.

    Args:
        changes: Environment variables on top of the server's; an empty value takes one away.
        inherited: File descriptors that it gets.
    """

    def __init__(self, changes: Mapping[str, str], inherited: tuple[int, ...]) -> None:
        # A group of its own: what a terminal or `timeout` sends to the server's group is the server's to handle.
        apart: dict[str, Any]
        if sys.platform == "win32":
            apart = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        else:
            apart = {"process_group": 0, "pass_fds": inherited}
        self._popen = subprocess.Popen(
            [sys.executable, "-m", "mjplug.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=environment(changes),
            **apart,
        )
        self._stdin = _pipe(self._popen.stdin)
        self._input = self._stdin.fileno()
        self._output = io.BufferedReader(_pipe(self._popen.stdout))  # type: ignore[type-var]

    def begin(self, setup: Setup, model: bytes, assignment: bytes) -> None:
        """Tells it who it is. A process that is gone already is noticed by `receive`."""
        with contextlib.suppress(OSError):
            for payload in (pack(setup), model, assignment):
                write(self._input, payload)

    def perform(self, slot: int, job: Job, wanted: Sequence[bool]) -> bool:
        """Asks a ready process to perform a job; returns whether it still listens. See `Performer.perform`."""
        try:
            # Plain values: a dataclass takes ten times as long, and this is the physics thread.
            write(self._input, pack((slot, wanted, job.time_ns, job.epoch, tuple(job.tasks))))
        except OSError:
            return False
        return True

    def receive(self) -> Any:
        """Waits for its next message; None when it has ended."""
        payload = read(self._output)
        return None if payload is None else unpack(payload)

    def hang_up(self) -> None:
        """Asks a ready process to end after its present job; nothing may be sent any more."""
        self._stdin.close()

    def kill(self) -> None:
        """Ends it at once."""
        self._popen.kill()

    def end(self) -> str:
        """Sees to it that it has ended, and returns how, for the log."""
        try:
            code = self._popen.wait(_DYING)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            code = self._popen.wait()
        self._stdin.close()
        self._output.close()
        return f"it was killed by {_signal(-code)}" if code < 0 else f"it ended with code {code}"


def environment(changes: Mapping[str, str]) -> dict[str, str]:
    """Returns the server's environment with some changes; an empty value takes a variable away."""
    merged = {**os.environ, **changes}
    return {name: value for name, value in merged.items() if changes.get(name, value) or name not in changes}


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    if stream is None:
        raise ValueError("the process was started without pipes")
    return stream


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
