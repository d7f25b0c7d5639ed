"""Runs the command line in a separate process."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

import warm_python
from machine import BYTECODE
from waits import TIMEOUT

STARTING = 90.0
"""How long a server may take to become ready on a machine with other work [s]."""

STOPPING = 30.0
"""How long it may take to stop on such a machine [s]; the server itself ends a stop that takes too long."""

COMMAND = (sys.executable, "-m", "mjplug")
FREE_PORT = ("--listen", "tcp/127.0.0.1:0")


def environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """What a user's shell has, without settings for mjplug, and with plain wide output."""
    foreign = ("MJPLUG_", "FORCE_COLOR", "PYTHONDONTWRITEBYTECODE")
    own = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
    plain = {"NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "200", "PYTHONPYCACHEPREFIX": BYTECODE}
    return own | plain | dict(more or {})


def run(
    *arguments: str,
    cwd: Path,
    env: Mapping[str, str] | None = None,
    within: float = STARTING,
    command: Iterable[str] = COMMAND,
) -> subprocess.CompletedProcess[str]:
    """Runs a command to its end."""
    return warm_python.run(tuple(command), arguments, cwd=cwd, env=environment(env), timeout=within)


class Lines:
    """The lines of a stream, read by a thread so that the writer never waits."""

    def __init__(self, stream):
        self._lines = []
        self._ended = False
        self._changed = threading.Condition()
        threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def wait_for(self, pattern, within=TIMEOUT):
        """Returns the match in the first line that has one; None when the stream ends without."""
        until = time.monotonic() + within
        seen = 0
        with self._changed:
            while True:
                for line in self._lines[seen:]:
                    if found := re.search(pattern, line):
                        return found
                seen = len(self._lines)
                if self._ended:
                    return None
                if not self._changed.wait(until - time.monotonic()):
                    raise AssertionError(f"no line with {pattern!r} within {within} s, but:\n{self.text}")

    def wait_for_end(self, within=TIMEOUT):
        """Returns the whole text."""
        with self._changed:
            assert self._changed.wait_for(lambda: self._ended, within), f"still open after {within} s"
        return self.text

    @property
    def text(self):
        return "".join(self._lines)

    def _read(self, stream):
        for line in stream:
            with self._changed:
                self._lines.append(line)
                self._changed.notify_all()
        stream.close()
        with self._changed:
            self._ended = True
            self._changed.notify_all()


def _is_worker(pid):
    try:
        return b"mjplug.worker" in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False


class Served:
    """A running `mjplug serve`."""

    def __init__(self, *arguments, cwd, env=None, command=COMMAND, listen=FREE_PORT):
        self.process = warm_python.popen(
            tuple(command), ("serve", *arguments, *listen),
            cwd=cwd, env=environment(env), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)
        try:
            ready = self.out.wait_for(r"ready.*?((?:tcp|tls)/\S+:\d+)", STARTING)
        except BaseException:
            self.kill()
            raise
        if ready is None:
            code = self.process.wait(STOPPING)
            raise AssertionError(f"ended with {code} before it was ready:\n{self.err.wait_for_end()}")
        self.ready, self.endpoint = ready.string, ready[1]

    @property
    def running(self):
        return self.process.poll() is None

    @property
    def workers(self):
        """The ids of its worker processes; it has another child, which sees to its end."""
        found = set()
        for children in Path(f"/proc/{self.process.pid}/task").glob("*/children"):
            # A thread may end meanwhile.
            with contextlib.suppress(OSError):
                found |= {int(pid) for pid in children.read_text().split() if _is_worker(pid)}
        return found

    def stop(self, number=signal.SIGINT, within=STOPPING):
        """Sends a signal and returns the exit code."""
        self.process.send_signal(number)
        return self.end(within)

    def end(self, within=TIMEOUT):
        """Waits until the server ends by itself; returns the exit code."""
        code = self.process.wait(within)
        self.out.wait_for_end()
        self.err.wait_for_end()
        return code

    def kill(self):
        if self.running:
            self.process.kill()
            self.process.wait()
