"""What runs in a worker process: it hears what to do, opens the work, and performs one job after the other."""

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
from mjplug.worker.messages import BEAT_INTERVAL, Beat, ChildEnvironment, Done, Failed, Ready, pack, read, unpack, write

if TYPE_CHECKING:
    from mjplug.worker.child_runner import ChildRunner


def main() -> None:
    """Runs the process to its end."""
    # Until the work is open: imports create many objects and leave little garbage.
    gc.disable()
    background.ignore_signals()
    line = _Line()
    first = line.receive()
    if first is None:
        return
    environment: ChildEnvironment = unpack(first)
    background.die_with(environment.parent)
    sys.path[:] = environment.sys_path
    _log_through(line, environment)
    # Before the priority of this thread is lowered, so that the signs of life come in time on a busy machine.
    threading.Thread(target=_beat, args=(line,), name="beat", daemon=True).start()
    code = _run(line, environment, logging.getLogger(f"{INSTANCES}.{environment.name}"))
    # Without Python's own teardown, in which libraries of GL drivers are known to crash.
    os._exit(code)


class _Line:
    """The pipes to the server. Whatever libraries print must not get into them, so standard output becomes error."""

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
                # The server is gone, which the end of the input says next.
                return


class _LogHandler(PrintableQueueHandler):
    """Sends log records to the server, as those of the plugin's instance."""

    def __init__(self, line: _Line, name: str) -> None:
        super().__init__(SimpleQueue())
        self._line = line
        self._name = name

    def enqueue(self, record: logging.LogRecord) -> None:
        if not record.name.startswith(INSTANCES):
            record.name = self._name
        self._line.send(record)


def _beat(line: _Line) -> None:
    while True:
        sleep(BEAT_INTERVAL)
        line.send(Beat())


def _log_through(line: _Line, environment: ChildEnvironment) -> None:
    root = logging.getLogger()
    root.addHandler(_LogHandler(line, f"{INSTANCES}.{environment.name}"))
    root.setLevel(environment.log_level)


def _run(line: _Line, environment: ChildEnvironment, logger: logging.Logger) -> int:
    try:
        import mujoco  # noqa: F401, PLC0415 - with some values of MUJOCO_GL and without their libraries, this fails
    except Exception as error:
        backend = os.environ.get("MUJOCO_GL")
        how = f" with MUJOCO_GL={backend}" if backend else ""
        line.send(Failed(f"MuJoCo cannot be imported{how}: {type(error).__name__}: {error}", permanent=True))
        return 1
    # Before anything makes threads, which inherit it; after the imports, which would take long on a busy machine.
    background.take_priority(environment.priority)
    runner = _open(line, environment, logger)
    if runner is None:
        return 1
    try:
        return _perform_jobs(line, runner, logger)
    finally:
        runner.close()


def _open(line: _Line, environment: ChildEnvironment, logger: logging.Logger) -> "ChildRunner | None":
    from mjplug.contracts.work import UnavailableError  # noqa: PLC0415 - imports MuJoCo
    from mjplug.errors import WireError  # noqa: PLC0415
    from mjplug.worker.child_runner import ChildRunner  # noqa: PLC0415

    # Large, and not needed beyond this function.
    model, setup = line.receive(), line.receive()
    if model is None or setup is None:
        return None
    runner = None
    try:
        runner = ChildRunner(unpack(setup), model, environment.states)
        said = runner.open(logger)
    except Exception as error:
        if runner is not None:
            runner.close()
        if isinstance(error, UnavailableError):
            line.send(Failed(str(error), permanent=True))
        elif isinstance(error, WireError):
            # The network may let it in another time.
            line.send(Failed(str(error)))
        else:
            logger.exception("the work could not be opened")
            # What the work raises now, it raises again.
            line.send(Failed(f"it could not be opened: {error!r}", permanent=True))
        return None
    gc.collect()
    gc.freeze()
    gc.enable()
    line.send(Ready(said))
    return runner


def _perform_jobs(line: _Line, runner: "ChildRunner", logger: logging.Logger) -> int:
    while (message := line.receive()) is not None:
        slot, wanted, lag, time_ns, epoch, tasks = unpack(message)
        try:
            line.send(Done(runner.perform(slot, time_ns, epoch, tasks, wanted, lag)))
        except Exception as error:
            logger.exception("%s could not be made", ", ".join(sorted(tasks)) or "a job")
            # A new process has a new GL context, among others; going on with a broken one would fail for ever.
            line.send(Failed(f"it failed: {error!r}"))
            return 1
    return 0
