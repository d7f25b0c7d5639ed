"""Works for worker processes; each does one thing, or one thing wrong."""

import logging
import os
import signal

import mujoco

from mjplug.plugin import UnavailableError, Work
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header


def message(data, job):
    """The state as a message: positions, and the poses of the bodies."""
    return JointState(
        header=Header(stamp=Time.from_ns(job.time_ns), frame_id=str(job.epoch)),
        name=sorted(job.tasks),
        position=data.qpos.tolist(),
        velocity=data.xpos.ravel().tolist(),
        effort=[data.time],
    )


class Tells(Work):
    """Publishes the state, and returns what it has seen."""

    def open(self, model, publishers, logger):
        (self.publisher,) = publishers
        self.logger = logger
        print("a library talks to standard output")
        return f"process {os.getpid()}"

    def perform(self, data, job):
        self.publisher.publish(message(data, job))
        return data.qpos.tolist(), self.publisher.matched


class Raises(Tells):
    """Fails at the task `bad`."""

    def perform(self, data, job):
        if "bad" in job.tasks:
            raise ValueError("a bad task")
        return os.getpid()


class Dies(Tells):
    """Kills itself at the task `die`."""

    def perform(self, data, job):
        if "die" in job.tasks:
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()


class Waits(Tells):
    """Is busy until the pipe at `path` has been opened and closed by a writer."""

    def __init__(self, path):
        self.path = str(path)

    def perform(self, data, job):
        with open(self.path, encoding="utf-8") as gate:
            gate.read()
        return data.time


class Picky(Tells):
    """Wants an environment in which WORKS_IN is `here`."""

    def open(self, model, publishers, logger):
        found = os.environ.get("WORKS_IN")
        if found != "here":
            raise UnavailableError(f"WORKS_IN is {found}")
        return f"{found} {os.environ.get('TAKEN_AWAY')}"


class Logs(Tells):
    """Logs, in its own name and in that of a library."""

    def perform(self, data, job):
        self.logger.debug("nobody wants to know")
        self.logger.warning("%s is due", *job.tasks)
        logging.getLogger("some.library").info("by a library")


class CrashesOnOpening(Tells):
    """Fails to open with an unexpected exception."""

    def open(self, model, publishers, logger):
        raise RuntimeError("no such thing")


class DiesLater(Tells):
    """Opens once, and never again."""

    def __init__(self, path):
        self.path = str(path)

    def open(self, model, publishers, logger):
        with open(self.path, "x", encoding="utf-8"):
            return "opened"

    def perform(self, data, job):
        os._exit(7)


class ReturnsTheUnspeakable(Tells):
    """Returns what does not pickle."""

    def perform(self, data, job):
        return lambda: None


class Fills(Tells):
    """Publishes large messages."""

    def __init__(self, size):
        self.size = size

    def perform(self, data, job):
        self.publisher.publish(JointState(name=("x" * self.size, *job.tasks)))


class Derives(Tells):
    """Returns more of the state, and what follows from it."""

    def open(self, model, publishers, logger):
        self.model = model
        return ""

    def perform(self, data, job):
        mujoco.mj_forward(self.model, data)
        return data.qvel.tolist(), data.act.tolist(), data.ctrl.tolist(), data.qacc.tolist()


class DiesOpening(Tells):
    """Is killed, as by a kernel without memory, the first time it opens."""

    def __init__(self, path):
        self.path = str(path)

    def open(self, model, publishers, logger):
        if not os.path.exists(self.path):
            open(self.path, "x", encoding="utf-8").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return os.environ.get("WORKS_IN")


class CrashesOpening(Tells):
    """Crashes, as drivers do, unless WORKS_IN is `here`."""

    def open(self, model, publishers, logger):
        if os.environ.get("WORKS_IN") != "here":
            os.kill(os.getpid(), signal.SIGILL)
        return "here"


class UnreadableError(Exception):
    """Pickles, and then cannot be unpickled."""

    def __init__(self, one, two):
        super().__init__(one)


class ReturnsTheUnreadable(Tells):
    """Returns what cannot be unpickled."""

    def perform(self, data, job):
        return UnreadableError(1, 2) if "bad" in job.tasks else os.getpid()


class Forks(Tells):
    """Starts a `multiprocessing` child that inherits the worker's pipe and outlives the worker."""

    def open(self, model, publishers, logger):
        self.forked = os.fork()
        if not self.forked:
            signal.pause()
        return ""

    def perform(self, data, job):
        return self.forked


class OpensLate(Tells):
    """Opens at once where WORKS_IN is `here`; elsewhere when the pipe at `path` is opened by a writer."""

    def __init__(self, path):
        self.path = str(path)

    def open(self, model, publishers, logger):
        if os.environ.get("WORKS_IN") != "here":
            open(self.path, encoding="utf-8").close()
        return "here"
