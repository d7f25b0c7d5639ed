"""What a plugin hands to a process of its own: making messages that are too costly for the physics thread.

A `Work` is built in the server, sent to the process, opened there, and then given one state of the world after the
other. Plugins write the `Work` and hold a `Worker`; who runs it is `WorkerPool`: processes in the server, the calling
thread in tests, nobody where there is no network.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from logging import Logger
from typing import Any, Literal, Protocol

import mujoco

from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.contracts.transport import Publisher
from mjplug.errors import MjplugError
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation


class UnavailableError(MjplugError):
    """A work cannot be done on this machine, or not in this environment; the sentence says what would help."""


@dataclass(frozen=True, slots=True)
class Job:
    """What to make of one state of the world.

    Attributes:
        time_ns: The state's simulated time [ns]; the stamp of everything made of it.
        epoch: Resets of the world before it.
        tasks: What is to be made, in the plugin's own words.
    """

    time_ns: int
    epoch: int
    tasks: frozenset[str]


class Work(ABC):
    """What runs in the process. It must pickle before `open`, so it holds settings; what is heavy is made by `open`."""

    @abstractmethod
    def open(self, model: mujoco.MjModel, publishers: Sequence[Publisher[Any]], logger: Logger) -> str:
        """Takes what it needs; called once, in the process, with its environment set.

        Args:
            model: A copy of the model, the work's own: it may be changed.
            publishers: Those given to `create_worker`, in their order, here to be published to.
            logger: Its lines appear in the server's log.

        Returns:
            What the user should know, for the log: `rendering with EGL (llvmpipe, software)`; may be empty.

        Raises:
            UnavailableError: It cannot be done in this environment; the next one is tried.
        """

    @abstractmethod
    def perform(self, data: mujoco.MjData, job: Job) -> Any:
        """Makes and publishes what the job names.

        Args:
            data: The state, with the kinematics of its positions.
            job: What to make, and the state's time.

        Returns:
            What the plugin's `on_done` gets; it must pickle.
        """

    def close(self) -> None:  # noqa: B027 - most works have nothing to release
        """Releases what `open` took; called also after an `open` that failed."""


NO_RENDERER: Sequence[Mapping[str, str]] = ({"MUJOCO_GL": "disable"},)
"""The environment of a work that renders nothing: MuJoCo is imported without OpenGL, which also is quicker."""


Priority = Literal["idle", "low", "normal"]
"""How much processor time a process gets beside other programs.

`idle`: only what no other program wants. `low`: less than physics and other programs, but never nothing. `normal`: as
much as any other program.
"""

JOB_TIMEOUT = 60.0
"""How long a job may take unless its plugin says otherwise [s]; time spent waiting for a processor does not count."""


def _ignore(*_: Any) -> None:
    pass


@dataclass(frozen=True, slots=True)
class WorkerSpec:
    """What a worker process does, and the callbacks that report on it, which run on the physics thread.

    Attributes:
        name: The plugin instance's name.
        work: What to do.
        publishers: What it publishes to.
        environments: Environment variables for the process, on top of the server's own; an empty value takes one away.
            They are tried in this order until the work opens, each in a process of its own.
        sync: Whether simulated time stands still after `submit` until the work is done: lockstep.
        priority: How much processor time the process gets beside other programs: `idle`, `low` or `normal`; in
            lockstep it is normal.
        job_timeout: How long a job may take [s]; then the process is ended and another one is started.
        hold: Called with True when simulated time must stand still, and with False when it may go on.
        on_ready: Gets what `Work.open` said, each time the work has been opened.
        on_done: Gets each job that was performed, and what `perform` returned.
        on_lost: Gets the tasks that will not be performed, and why: the process died, `perform` raised, or the work
            is unavailable.
    """

    name: str
    work: Work
    publishers: Sequence[Publisher[Any]]
    environments: Sequence[Mapping[str, str]] = NO_RENDERER
    sync: bool = False
    priority: Priority = "low"
    job_timeout: float = JOB_TIMEOUT
    hold: Callable[[bool], None] = _ignore
    on_ready: Callable[[str], None] = _ignore
    on_done: Callable[[Job, Any], None] = _ignore
    on_lost: Callable[[frozenset[str], str], None] = _ignore


@dataclass(slots=True)
class WorkerStatus:
    """State and counters of a worker.

    Attributes:
        state: `starting`, `running`, `restarting` or `unavailable`; `unavailable` is final.
        reason: Why it does not run; empty while it does.
        performed: Jobs done.
        dropped: By task, how often a newer state took the place of one that had waited.
        restarts: How often the process had to be started again.
        starved: Part of the time in which its threads wanted to compute, in the last second, that they waited for a
            processor; 0 where the system does not tell.
    """

    state: str = "starting"
    reason: str = ""
    performed: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    restarts: int = 0
    starved: float = 0.0


def worker_diagnosis(status: WorkerStatus) -> Diagnosis:
    """Returns the status of a worker, for `Host.create_diagnostic`.

    Without a process at work there is an error if it stays so, a warning if it is being started again.
    """
    level = {"unavailable": Level.ERROR, "restarting": Level.WARN}.get(status.state, Level.OK)
    values: dict[str, object] = {
        "state": status.state,
        "jobs performed": status.performed,
        "states dropped": sum(status.dropped.values()),
        "restarts": status.restarts,
        "waiting for a processor (%)": round(100.0 * status.starved),
    }
    values |= {f"states dropped for {task}": count for task, count in sorted(status.dropped.items())}
    return Diagnosis(level, f"{status.state}: {status.reason}" if status.reason else status.state, values)


class Worker(Protocol):
    """A work under way, as its plugin sees it. Physics thread only."""

    @property
    def status(self) -> WorkerStatus:
        """Its state and counters, for diagnostics."""

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
        """Hands over the present state, to be made into `tasks`.

        It never waits; if the spec is `sync`, the server takes no further step until the job is done or lost, and
        serves requests meanwhile. One job is performed at a time; a newer state takes the place of
        one that waits, which keeps its tasks: those in both are counted as dropped once. An unavailable worker
        answers with `on_lost`.

        Args:
            tasks: What to make.
            answered: Whether somebody gets an answer when they are made, and may have begun to listen a moment ago: the
                process then waits until it knows of every listener that the network knows of now.
        """


class WorkerPool(Protocol):
    """Runs works, each in a worker of its own."""

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> Worker:
        """Starts one; it gets ready in its own time.

        Args:
            spec: What it does.
            simulation: Where `submit` takes the state from.
            inbox: Through which the callbacks of the spec reach the physics thread.
        """

    def close(self) -> None:
        """Ends all of them; a second call does nothing."""
