"""A Python that has imported what takes long, and forks itself for each program that a test starts.

What a test starts is a real process: with arguments, a folder, an environment, standard streams, signals and an exit
code of its own. It does without the 0.6 s of processor time that importing MuJoCo, NumPy and pydantic takes. Programs
that must import for themselves (those that look at imports, or use another Python) are started the usual way.
"""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from pathlib import Path

PRELOADED = (
    "mjplug.cli.app",
    "mjplug.cli.doctor.command",
    "mjplug.cli.exit_codes",
    "mjplug.cli.topic_echo",
    "mjplug.client",
    "mjplug.lifecycle.serve",
    "mjplug.server.prepared",
    "mjplug.server.open_server",
    "mjplug_plugins.external_wrench",
    "mjplug_plugins.heartbeat",
)

_AT_START = ("PYTHON", "LC_", "LANG", "MALLOC_", "LD_", "OPENBLAS_", "OMP_", "GLIBC_")
"""How the names of those variables begin that only the start of a process obeys."""

_CAN_FOLLOW = ("PYTHONUNBUFFERED", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE")
"""Those among them that a running Python can obey too."""

enabled = False
"""Whether programs are forked off: in tests, but not in the long runs of `tests/hostile`, which measure memory."""


class Process:
    """A program that was forked off, as `subprocess.Popen` has it."""

    def __init__(self, server, pid, stdout, stderr):
        self._server = server
        self._descriptor = os.pidfd_open(pid)
        self.pid, self.returncode = pid, None
        self.stdout, self.stderr = stdout, stderr

    def poll(self):
        """Returns the exit code; None while the program runs."""
        return self._await(0.0)

    def wait(self, timeout=None):
        """Waits for the end of the program; returns its exit code, negative for a signal."""
        if self._await(timeout) is None:
            raise subprocess.TimeoutExpired([f"process {self.pid}"], timeout)
        return self.returncode

    def send_signal(self, number):
        """Sends a signal to a program that has not been waited for."""
        if self.poll() is None:
            signal.pidfd_send_signal(self._descriptor, number)

    def terminate(self):
        self.send_signal(signal.SIGTERM)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout=None):
        """Waits for the end; returns what is left in the pipes, which must not be more than they can hold."""
        self.wait(timeout)
        texts = [
            stream.read() if stream is not None and not stream.closed else None for stream in (self.stdout, self.stderr)
        ]
        for stream in (self.stdout, self.stderr):
            if stream is not None:
                stream.close()
        return tuple(texts)

    def _await(self, timeout):
        if self.returncode is None:
            poll = select.poll()
            poll.register(self._descriptor, select.POLLIN)
            if poll.poll(None if timeout is None else timeout * 1000):
                self.returncode = self._server.reap(self.pid)
        return self.returncode

    def __del__(self):
        os.close(self._descriptor)


class WarmPython:
    """The process that forks; started with the first program. From any thread."""

    def __init__(self):
        self._line = self._python = None
        self._lock = threading.Lock()

    def start(self, options, arguments, cwd, env, stdout, stderr):
        """Forks a program off; returns its process id.

        Args:
            options: Python's options: `-m MODULE` or `-W error SCRIPT`.
            arguments: What the program gets.
            cwd: Its folder.
            env: Its environment.
            stdout: File descriptor of its standard output.
            stderr: File descriptor of its standard error.
        """
        order = {"options": list(options), "arguments": list(arguments), "cwd": str(cwd), "env": dict(env)}
        with open(os.devnull, encoding="utf-8") as nothing:
            return self._ask(order, [nothing.fileno(), stdout, stderr])

    def reap(self, pid):
        """Returns the exit code of a program that has ended."""
        return self._ask({"reap": pid}, [])

    def _ask(self, order, descriptors):
        with self._lock:
            if self._line is None:
                self._open()
            socket.send_fds(self._line, [json.dumps(order).encode()], descriptors)
            answer = self._line.recv(64)
        assert answer, "the Python that forks has ended"
        return int(answer)

    def close(self):
        """Ends it, and with it all programs that still run."""
        with self._lock:
            if self._line is not None:
                self._line.close()
                self._python.wait()
                self._line = None

    def _open(self):
        self._line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        with other:
            # Without a terminal, so that what is forked off buffers its output as it does into a pipe.
            self._python = subprocess.Popen(
                [sys.executable, str(Path(__file__)), str(other.fileno())],
                pass_fds=[other.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            )  # fmt: skip
        assert self._line.recv(64) == b"ready"


_warm = WarmPython()
close = _warm.close


def popen(command, arguments, *, cwd, env, stdout=None, stderr=None, text=True):
    """Starts a program as `subprocess.Popen` does; forks it off where that makes no difference."""
    if not _can_fork(command, env):
        return subprocess.Popen([*command, *arguments], cwd=cwd, env=env, stdout=stdout, stderr=stderr, text=text)
    ours, theirs = [], []
    for number, stream in enumerate((stdout, stderr), start=1):
        reading, writing = os.pipe() if stream == subprocess.PIPE else (None, number if stream is None else stream)
        ours.append(None if reading is None else open(reading, "r" if text else "rb"))  # noqa: SIM115 - as Popen's
        theirs.append(theirs[0] if writing == subprocess.STDOUT else writing)
    try:
        descriptors = [one if isinstance(one, int) else one.fileno() for one in theirs]
        return Process(_warm, _warm.start(command[1:], arguments, cwd, env, *descriptors), *ours)
    finally:
        for stream, descriptor in zip((stdout, stderr), theirs, strict=True):
            if stream == subprocess.PIPE:
                os.close(descriptor)


def run(command, arguments, *, cwd, env, timeout, one_stream=False):
    """Runs a program to its end as `subprocess.run` does, with its output as text; forks it off where it can.

    Args:
        command: The program.
        arguments: What it gets.
        cwd: Its folder.
        env: Its environment.
        timeout: How long it may take [s].
        one_stream: Whether its errors go where its output goes.
    """
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        errors = subprocess.STDOUT if one_stream else err
        program = popen(command, arguments, cwd=cwd, env=env, stdout=out, stderr=errors)
        try:
            code = program.wait(timeout)
        finally:
            program.kill()
            program.wait()
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read())
    return subprocess.CompletedProcess([*command, *arguments], code, *texts)


def _can_fork(command, env):
    """Whether a command is `python -m MODULE` or `python -W error SCRIPT`, and nothing needs a new process."""
    python, *options = command
    known = (options[:-1] == ["-m"], options[:-1] == ["-W", "error"] and options[-1].endswith(".py"))
    return (
        enabled
        and sys.platform == "linux"
        and python == sys.executable
        and any(known)
        and _of_the_start(env) == _of_the_start(os.environ)
    )


def _of_the_start(env):
    return {name: value for name, value in env.items() if name.startswith(_AT_START) and name not in _CAN_FOLLOW}


def _serve(line):
    """Forks until the line is closed; returns, in each program that was forked off, what it is to be."""
    import importlib

    from mjplug.cli.engine import import_mujoco

    # A Ctrl-C is for the tests, which see to the end of what they have started.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    import_mujoco()
    for module in PRELOADED:
        importlib.import_module(module)
    import gc

    gc.collect()
    gc.freeze()
    assert len(os.listdir("/proc/self/task")) == 1, "a process with threads cannot fork"
    running = set()
    line.send(b"ready")
    while True:
        message, descriptors, _, _ = socket.recv_fds(line, 1 << 20, 3)
        if not message:
            break
        order = json.loads(message)
        if "reap" in order:
            _, status = os.waitpid(order["reap"], 0)
            running.discard(order["reap"])
            line.send(str(os.waitstatus_to_exitcode(status)).encode())
            continue
        pid = os.fork()
        if pid == 0:
            line.close()
            return order, descriptors
        for descriptor in descriptors:
            os.close(descriptor)
        running.add(pid)
        line.send(str(pid).encode())
    for pid in running:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    os._exit(0)


def _become(order, descriptors):
    """Makes this process what was ordered."""
    option, *_, program = order["options"]
    for number, descriptor in enumerate(descriptors):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.chdir(order["cwd"])
    os.environ.clear()
    os.environ.update(order["env"])
    sys.stdout.reconfigure(write_through=bool(os.environ.get("PYTHONUNBUFFERED")))
    sys.dont_write_bytecode = bool(os.environ.get("PYTHONDONTWRITEBYTECODE"))
    sys.pycache_prefix = os.environ.get("PYTHONPYCACHEPREFIX")
    sys.argv[1:] = order["arguments"]
    sys.path[0] = os.path.dirname(program) if program.endswith(".py") else os.getcwd()
    if option == "-W":
        sys.warnoptions.append("error")
        warnings.simplefilter("error")
    time.tzset()
    import gc

    gc.unfreeze()
    signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    _order, _descriptors = _serve(socket.socket(fileno=int(sys.argv[1])))
    _become(_order, _descriptors)
    import runpy

    if _order["options"][0] == "-m":
        runpy.run_module(_order["options"][1], run_name="__main__", alter_sys=True)
    else:
        sys.argv[0] = _order["options"][-1]
        runpy.run_path(_order["options"][-1], run_name="__main__")
