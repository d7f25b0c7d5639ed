"""One worker process as the server sees it: started, talked to, ended."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import IO, Any

from mjplug.contracts.work import Job
from mjplug.worker.messages import ChildEnvironment, Failed, pack, read, unpack, write

if sys.platform == "linux":
    import fcntl

PIPE_SIZE = 1 << 20
"""Bytes that the pipe to a process holds, where the system allows it.

The physics thread writes jobs to it, and a stopped process reads nothing: with Linux's 64 KiB, a job with thousands of
tasks would block physics.
"""

_EXIT_GRACE = 1.0
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
            # Without the current folder: a `queue.py` that lies there is not Python's.
            [sys.executable, "-P", "-m", "mjplug.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=environment(changes),
            **apart,
        )
        self._stdin = _pipe(self._popen.stdin)
        self._input = self._stdin.fileno()
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                fcntl.fcntl(self._input, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        self._output = io.BufferedReader(_pipe(self._popen.stdout))  # type: ignore[type-var]

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._popen.pid

    def begin(self, environment: ChildEnvironment, model: bytes, setup: bytes) -> None:
        """Tells it who it is. A process that is gone already is noticed by `receive`."""
        with contextlib.suppress(OSError):
            for payload in (pack(environment), model, setup):
                write(self._input, payload)

    def perform(self, slot: int, job: Job, wanted: Sequence[bool], lag: float) -> bool:
        """Asks a ready process to perform a job; returns whether it still listens. See `ChildRunner.perform`."""
        try:
            # Plain values: a dataclass takes ten times as long, and this is the physics thread.
            write(self._input, pack((slot, wanted, lag, job.time_ns, job.epoch, tuple(job.tasks))))
        except OSError:
            return False
        return True

    def receive(self) -> Any:
        """Waits for its next message; None when it has ended. What cannot be understood ends it."""
        payload = read(self._output)
        if payload is None:
            return None
        try:
            return unpack(payload)
        except Exception as error:
            # A report may pickle, and then not unpickle: exceptions with arguments of their own are like that.
            self.kill()
            return Failed(f"what came from the process cannot be unpickled: {error!r}")

    def close_input(self) -> None:
        """Asks a ready process to end after its present job; nothing may be sent any more."""
        self._stdin.close()

    def kill(self) -> None:
        """Ends it at once, with what it has started, since that may have its pipes too."""
        if sys.platform == "win32":
            self._popen.kill()
        elif self._popen.returncode is None:
            # Not waited for yet, so that the number of its group is no other's.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)

    @property
    def killed(self) -> bool:
        """Whether it has been ended from outside, as the kernel does when memory runs out."""
        return sys.platform != "win32" and self._popen.returncode == -signal.SIGKILL

    def end(self) -> str:
        """Sees to it that it has ended, and returns how, for the log. Nothing may be sent any more."""
        try:
            code = self._popen.wait(_EXIT_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self._popen.wait()
        self._stdin.close()
        self._output.close()
        return f"it was killed by {_signal(-code)}" if code < 0 else f"it ended with code {code}"


_DEFAULTS = {"OPENBLAS_NUM_THREADS": "1"}
"""NumPy's threads for linear algebra spin when they are created, and would take processor time from physics."""


def environment(changes: Mapping[str, str]) -> dict[str, str]:
    """Returns the server's environment with some changes; an empty value takes a variable away."""
    full = {**_DEFAULTS, **os.environ, **changes}
    return {name: value for name, value in full.items() if value or name not in changes}


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    if stream is None:
        raise ValueError("the process was started without pipes")
    return stream


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
