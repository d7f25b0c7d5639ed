"""The main program of a worker process: it receives the setup, opens the work, and performs jobs one by one."""

import gc
import logging
import os
import sys
import threading
from queue import SimpleQueue
from time import sleep
from typing import TYPE_CHECKING, Any

from mjplug.log import INSTANCES, PrintableQueueHandler
from mjplug.worker import background
from mjplug.worker.messages import (
    HEARTBEAT_INTERVAL,
    ChildEnvironment,
    Done,
    Failed,
    Heartbeat,
    Ready,
    pack,
    read,
    unpack,
    write,
)

if TYPE_CHECKING:
    from mjplug.worker.child_runner import ChildRunner


def main() -> None:
    """Runs the process to its end."""
    # Until the work is open, because imports create many objects but little garbage.
    gc.disable()
    background.ignore_signals()
    pipes = _Pipes()
    first = pipes.receive()
    if first is None:
        return
    environment: ChildEnvironment = unpack(first)
    background.exit_with_parent(environment.parent)
    sys.path[:] = environment.sys_path
    _log_through(pipes, environment)
    # Before the priority of this thread is lowered, so that heartbeats are sent in time on a busy machine.
    threading.Thread(target=_send_heartbeats, args=(pipes,), name="beat", daemon=True).start()
    code = _run(pipes, environment, logging.getLogger(f"{INSTANCES}.{environment.name}"))
    # Skips Python's own shutdown, in which libraries of GL drivers may crash.
    os._exit(code)


class _Pipes:
    """The pipes to the server. Standard output is redirected to standard error, so that prints do not get into them."""

    def __init__(self) -> None:
        self._out = os.dup(1)
        os.dup2(2, 1)
        self._lock = threading.Lock()

    def receive(self) -> bytes | None:
        return read(sys.stdin.buffer)

    def send(self, message: Any) -> None:
        payload = pack(message)
        with self._lock:
            try:
                write(self._out, payload)
            except OSError:
                # The server has ended; `receive` then returns None.
                return


class _LogHandler(PrintableQueueHandler):
    """Sends log records to the server under the logger of the plugin instance."""

    def __init__(self, pipes: _Pipes, name: str) -> None:
        super().__init__(SimpleQueue())
        self._pipes = pipes
        self._name = name

    def enqueue(self, record: logging.LogRecord) -> None:
        if not record.name.startswith(INSTANCES):
            record.name = self._name
        self._pipes.send(record)


def _send_heartbeats(pipes: _Pipes) -> None:
    while True:
        sleep(HEARTBEAT_INTERVAL)
        pipes.send(Heartbeat())


def _log_through(pipes: _Pipes, environment: ChildEnvironment) -> None:
    root = logging.getLogger()
    root.addHandler(_LogHandler(pipes, f"{INSTANCES}.{environment.name}"))
    root.setLevel(environment.log_level)


def _run(pipes: _Pipes, environment: ChildEnvironment, logger: logging.Logger) -> int:
    try:
        import mujoco  # noqa: F401, PLC0415 - with some values of MUJOCO_GL and without their libraries, this fails
    except Exception as error:
        backend = os.environ.get("MUJOCO_GL")
        how = f" with MUJOCO_GL={backend}" if backend else ""
        pipes.send(Failed(f"MuJoCo cannot be imported{how}: {type(error).__name__}: {error}", permanent=True))
        return 1
    try:
        _load_engine_plugins(environment.plugin_libraries)
    except Exception as error:
        pipes.send(Failed(str(error), permanent=True))
        return 1
    # Before threads are started, because they inherit it; after the imports, which would be slow on a busy machine.
    background.set_priority(environment.priority)
    runner = _open(pipes, environment, logger)
    if runner is None:
        return 1
    try:
        return _perform_jobs(pipes, runner, logger)
    finally:
        runner.close()


def _load_engine_plugins(paths: tuple[str, ...]) -> None:
    if paths:
        from pathlib import Path  # noqa: PLC0415

        from mjplug.model import engine_plugins  # noqa: PLC0415 - imports MuJoCo

        for path in paths:
            engine_plugins.load(Path(path))


def _open(pipes: _Pipes, environment: ChildEnvironment, logger: logging.Logger) -> "ChildRunner | None":
    from mjplug.contracts.work import UnavailableError  # noqa: PLC0415 - imports MuJoCo
    from mjplug.errors import WireError  # noqa: PLC0415
    from mjplug.worker.child_runner import ChildRunner  # noqa: PLC0415

    # Local variables, because the messages are large and needed only here.
    model, setup = pipes.receive(), pipes.receive()
    if model is None or setup is None:
        return None
    runner = None
    try:
        runner = ChildRunner(unpack(setup), model, environment.states)
        text = runner.open(logger)
    except Exception as error:
        if runner is not None:
            runner.close()
        if isinstance(error, UnavailableError):
            pipes.send(Failed(str(error), permanent=True))
        elif isinstance(error, WireError):
            # The network may accept a later connection.
            pipes.send(Failed(str(error)))
        else:
            logger.exception("opening the work failed")
            # Another attempt would raise the same exception.
            pipes.send(Failed(f"opening the work failed: {error!r}", permanent=True))
        return None
    gc.collect()
    gc.freeze()
    gc.enable()
    pipes.send(Ready(text))
    return runner


def _perform_jobs(pipes: _Pipes, runner: "ChildRunner", logger: logging.Logger) -> int:
    from mjplug.contracts.work import Job  # noqa: PLC0415 - imports MuJoCo

    while (message := pipes.receive()) is not None:
        slot, matched, lag, time_ns, epoch, lineage, tasks, context = unpack(message)
        try:
            job = Job(time_ns, epoch, frozenset(tasks), context, lineage)
            pipes.send(Done(runner.perform(slot, job, matched, lag)))
        except Exception as error:
            logger.exception("performing %s failed", ", ".join(sorted(tasks)) or "a job")
            # A new process has a new GL context; with a broken context, all later jobs would fail too.
            pipes.send(Failed(f"a job failed: {error!r}"))
            return 1
    return 0
