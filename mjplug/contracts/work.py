"""Work that is too slow for the physics thread and runs in a worker process.

A `Work` is created in the server, pickled to the worker process and opened there; then it performs jobs, each with one
state of the simulation. The plugin defines the `Work` and gets a `Worker`, to which it submits jobs. A `WorkerPool`
runs it: in worker processes in the server, in the calling thread in tests.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from logging import Logger
from typing import Any, Literal, Protocol

import mujoco

from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.contracts.transport import BytesPublisher, Publisher
from mjplug.errors import MjplugError
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation


class UnavailableError(MjplugError):
    """A work cannot be opened on this machine or in this environment; the message says what would help."""


@dataclass(frozen=True, slots=True)
class Job:
    """The tasks to perform with one state of the simulation.

    Attributes:
        time_ns: Simulated time of the state [ns]; the time stamp of all messages made from it.
        epoch: Number of resets and restored states before the state.
        tasks: Names of the tasks; the plugin chooses them.
        context: The value that was given to `submit` with the state.
        lineage: Number of resets in the past of the state, for the seeds of noise; see `Host.lineage`.
    """

    time_ns: int
    epoch: int
    tasks: frozenset[str]
    context: Any = None
    lineage: int = 0


class Work(ABC):
    """The code that runs in the worker process.

    It must be picklable before `open`, so keep only settings in it and create other resources in `open`.
    """

    @abstractmethod
    def open(self, model: mujoco.MjModel, publishers: Sequence[Any], logger: Logger) -> str:
        """Acquires resources. Called once in the worker process, after its environment variables were set.

        Args:
            model: A copy of the model for this work alone; it may be changed.
            publishers: The publishers given to `create_worker`, in the same order.
            logger: Its lines appear in the server's log.

        Returns:
            Text for the log, such as `rendering with EGL (llvmpipe, software)`; may be empty.

        Raises:
            UnavailableError: The work cannot run in this environment; the next environment is tried.
        """

    @abstractmethod
    def perform(self, data: mujoco.MjData, job: Job) -> Any:
        """Performs the tasks of a job and publishes the results.

        Args:
            data: The state; body poses are computed, contacts and forces are not.
            job: The tasks and the time of the state.

        Returns:
            A picklable value, which is passed to the plugin's `on_done`.
        """

    def close(self) -> None:  # noqa: B027 - most works have nothing to release
        """Releases the resources that `open` acquired; also called if `open` failed."""


NO_RENDERER: Sequence[Mapping[str, str]] = ({"MUJOCO_GL": "disable"},)
"""The environment of a work that does not render. MuJoCo is then imported without OpenGL, which is also faster."""

Priority = Literal["idle", "low", "normal"]
"""CPU priority of a worker process.

`idle`: runs only when no other program uses the CPU. `low`: gets less CPU time than physics and other programs.
`normal`: gets as much CPU time as any other program.
"""

JOB_TIMEOUT = 60.0
"""Default maximum time of a job [s]; the time in which the process waits for a CPU does not count."""


def _ignore(*_: Any) -> None:
    pass


@dataclass(frozen=True, slots=True)
class WorkerSpec:
    """The work of a worker process, its settings, and the callbacks, which run on the physics thread.

    Attributes:
        name: The plugin instance's name.
        work: The work.
        publishers: The publishers that the work uses.
        environments: Environment variables for the process, in addition to the server's; an empty value removes a
            variable. They are tried in this order until the work opens, each in a new process.
        sync: Whether the loop takes no step after `submit` until the job is done (lockstep).
        priority: CPU priority of the process: `idle`, `low` or `normal`. In lockstep it is always normal.
        job_timeout: Maximum time of a job [s]; after it, the process is killed and restarted.
        block_steps: Called with True when the loop must take no step, and with False when it may continue.
        on_ready: Called with the text that `Work.open` returned, each time the work has been opened.
        on_done: Called with each completed job and the return value of `perform`.
        on_lost: Called with the tasks that will not be performed, and the reason: the process died, `perform` raised
            an exception, or the work is unavailable.
        save_later: Whether the model is saved in the background, after `start` has returned. Use it for a worker that
            is started while physics runs, because saving a large model takes up to a second. Later changes of the
            model may then be in the worker's copy.
    """

    name: str
    work: Work
    publishers: Sequence[Publisher[Any] | BytesPublisher]
    environments: Sequence[Mapping[str, str]] = NO_RENDERER
    sync: bool = False
    priority: Priority = "low"
    job_timeout: float = JOB_TIMEOUT
    block_steps: Callable[[bool], None] = _ignore
    on_ready: Callable[[str], None] = _ignore
    on_done: Callable[[Job, Any], None] = _ignore
    on_lost: Callable[[frozenset[str], str], None] = _ignore
    save_later: bool = False


@dataclass(slots=True)
class WorkerStatus:
    """State and counters of a worker.

    Attributes:
        state: `starting`, `running`, `restarting` or `unavailable`; `unavailable` is final.
        reason: Why the worker does not run; empty while it runs.
        performed: Number of completed jobs.
        dropped: How often a newer state replaced a waiting one, by task.
        restarts: How often the process was restarted.
        starved: Share of its runnable time in the last second in which the process waited for a CPU, 0 to 1; 0 if the
            operating system does not report it.
    """

    state: str = "starting"
    reason: str = ""
    performed: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    restarts: int = 0
    starved: float = 0.0


def worker_diagnosis(status: WorkerStatus) -> Diagnosis:
    """Returns the status of a worker, for `Host.create_diagnostic`.

    The level is ERROR if the worker is unavailable, WARN while it restarts, and otherwise OK.
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
    """A running work, to which its plugin submits jobs. Physics thread only."""

    @property
    def status(self) -> WorkerStatus:
        """State and counters, for diagnostics."""

    def submit(self, tasks: Iterable[str], answered: bool = False, context: Any = None) -> None:
        """Submits a job: tasks to perform with the current state.

        It never waits. If the worker is `sync`, the server takes no further step until the job is done or lost, but
        serves requests meanwhile. The process performs one job at a time. If a job already waits, the new state
        replaces the state of that job and the tasks are merged; tasks in both are counted as dropped once. If the
        worker is unavailable, `on_lost` is called.

        Args:
            tasks: Names of the tasks.
            answered: Whether a client gets a response when the job is done. The client may have subscribed just before,
                so the process first waits until it has matched all subscribers that the server has matched now.
            context: A small picklable value that belongs to the state. Like the state, a newer one replaces one that
                waits.
        """

    def stop(self) -> None:
        """Ends the worker for good and returns at once. Its jobs are lost; callbacks may still be called meanwhile."""


class WorkerPool(Protocol):
    """Runs works, each in its own worker."""

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> Worker:
        """Starts a worker and returns without waiting until it is ready.

        Args:
            spec: The work and its settings.
            simulation: The simulation whose state `submit` copies.
            inbox: The inbox of the physics thread, on which the callbacks of the spec run.
        """

    def prepare(self, model: mujoco.MjModel) -> None:
        """Prepares a changed model for the workers, so that starting them takes no time. Any thread."""

    def close(self) -> None:
        """Stops all workers; a second call does nothing."""
