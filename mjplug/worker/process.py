"""The server's side of one worker process: start, messages, end."""

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
"""Size of the pipe to a process, if the operating system allows it [bytes].

The physics thread writes jobs to the pipe. If the process is stopped and does not read, a job with thousands of tasks
would block physics with Linux's default of 64 KiB.
"""

_EXIT_GRACE = 1.0
"""Time for a process to end after its last message before it is killed [s]."""


class WorkerProcess:
    """A running `python -m mjplug.worker`. It ends with the thread that creates it, which must also read from it.

    Args:
        changes: Environment variables in addition to the server's; an empty value removes a variable.
        inherited: File descriptors that the process inherits.
    """

    def __init__(self, changes: Mapping[str, str], inherited: tuple[int, ...]) -> None:
        # In its own process group, because the server handles signals that a terminal or `timeout` sends to its group.
        options: dict[str, Any]
        if sys.platform == "win32":
            options = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        else:
            options = {"process_group": 0, "pass_fds": inherited}
        self._popen = subprocess.Popen(
            # -P: a `queue.py` in the current folder must not replace Python's module.
            [sys.executable, "-P", "-m", "mjplug.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=environment(changes),
            **options,
        )
        self._stdin = _pipe(self._popen.stdin)
        self._input = self._stdin.fileno()
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                fcntl.fcntl(self._input, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        self._output = io.BufferedReader(_pipe(self._popen.stdout))  # type: ignore[type-var]

    @property
    def pid(self) -> int:
        """The process id."""
        return self._popen.pid

    def begin(self, environment: ChildEnvironment, model: memoryview, setup: bytes) -> None:
        """Sends the first messages. If the process has already ended, `receive` returns None."""
        with contextlib.suppress(OSError):
            for payload in (pack(environment), model, setup):
                write(self._input, payload)

    def perform(self, slot: int, job: Job, matched: Sequence[bool], lag: float) -> bool:
        """Sends a job to a ready process; returns False if the process has ended. See `ChildRunner.perform`."""
        try:
            # A tuple of plain values, because pickling a dataclass takes ten times as long on the physics thread.
            values = slot, matched, lag, job.time_ns, job.epoch, job.lineage, tuple(job.tasks), job.context
            write(self._input, pack(values))
        except OSError:
            return False
        return True

    def receive(self) -> Any:
        """Waits for the next message of the process and returns it; None if the process has ended.

        If a message cannot be unpickled, the process is killed and a `Failed` is returned.
        """
        payload = read(self._output)
        if payload is None:
            return None
        try:
            return unpack(payload)
        except Exception as error:
            # A picklable report may fail to unpickle, such as an exception class with its own constructor arguments.
            self.kill()
            return Failed(f"a message of the process cannot be unpickled: {error!r}")

    def close_input(self) -> None:
        """Closes the input, so that a ready process ends after its current job. Send no message afterwards."""
        self._stdin.close()

    def kill(self) -> None:
        """Kills the process and its child processes, because these may hold its pipes too."""
        if sys.platform == "win32":
            self._popen.kill()
        elif self._popen.returncode is None:
            # The process was not waited for yet, so its group id is not reused.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)

    @property
    def killed(self) -> bool:
        """Whether the process was killed by SIGKILL, as the kernel does when memory runs out."""
        return sys.platform != "win32" and self._popen.returncode == -signal.SIGKILL

    def end(self) -> str:
        """Waits until the process has ended, and kills it if needed; returns how it ended, for the log."""
        try:
            code = self._popen.wait(_EXIT_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self._popen.wait()
        self._stdin.close()
        self._output.close()
        return f"the process was killed by {_signal(-code)}" if code < 0 else f"the process exited with code {code}"


_DEFAULTS = {"OPENBLAS_NUM_THREADS": "1"}
"""NumPy's threads for linear algebra busy-wait after their start, which would take CPU time from physics."""


def environment(changes: Mapping[str, str]) -> dict[str, str]:
    """Returns the server's environment variables with some changes; an empty value removes a variable."""
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
