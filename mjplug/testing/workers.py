"""Workers without processes. A test decides when a job is performed."""

import copy
import logging
import pickle
from collections import Counter
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.contracts.remote_samples import perform
from mjplug.contracts.work import Job, UnavailableError, Work, WorkerSpec, WorkerStatus
from mjplug.physics import snapshot
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation


class InlineWorker:
    """Performs each job at once, in the calling thread. Implements `mjplug.contracts.work.Worker`.

    Attributes:
        status: State and counters.
        spec: The work and its callbacks.
        work: A copy of the plugin's work, as in a worker process.
        stopped: Whether `stop` was called.

    Args:
        spec: As above.
        simulation: The simulation whose state is copied for each job.
        inbox: Passes the calls of the spec's callbacks to the physics thread.
    """

    def __init__(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> None:
        self.status = WorkerStatus()
        self.spec = spec
        self._simulation = simulation
        self._inbox = inbox
        self.stopped = False
        self._hold = False
        self._waiting: tuple[Job, NDArray[np.float64]] | None = None
        model = copy.copy(simulation.model)
        self._model, self._data = model, mujoco.MjData(model)
        self.work: Work = pickle.loads(pickle.dumps(spec.work))
        try:
            said = self.work.open(model, spec.publishers, logging.getLogger("worker"))
        except UnavailableError as error:
            self.status.state, self.status.reason = "unavailable", str(error)
            inbox.post(lambda: spec.on_lost(frozenset(), self.status.reason))
        else:
            self.status.state = "running"
            inbox.post(lambda: spec.on_ready(said))

    def submit(self, tasks: Iterable[str], answered: bool = False, context: Any = None) -> None:
        """Copies the current state, and performs the job unless `hold` was called."""
        wanted = frozenset(tasks)
        if self.status.state == "unavailable":
            self._inbox.post(lambda: self.spec.on_lost(wanted, self.status.reason))
            return
        simulation = self._simulation
        state = np.empty(snapshot.size(simulation.model))
        snapshot.take(simulation.model, simulation.data, state)
        if self._waiting is not None:
            before = self._waiting[0].tasks
            self.status.dropped = dict(Counter(self.status.dropped) + Counter(wanted & before))
            wanted |= before
        self._waiting = Job(simulation.time_ns, simulation.epoch, wanted, context, simulation.lineage), state
        if not self._hold:
            self._perform()

    def stop(self) -> None:
        """Closes the work; see `stopped`."""
        self.stopped = True
        self.work.close()

    def hold(self) -> None:
        """Keeps later jobs waiting, as a busy process does. A newer job replaces the waiting one."""
        self._hold = True

    def release(self) -> None:
        """Performs the waiting job, and each later one at once."""
        self._hold = False
        if self._waiting is not None:
            self._perform()

    def _perform(self) -> None:
        assert self._waiting is not None
        (job, state), self._waiting = self._waiting, None
        snapshot.load(self._model, self._data, state)
        # Pickled, as between processes.
        report: Any = pickle.loads(pickle.dumps(perform(self.work, self._data, job, self.spec.publishers)))
        self.status.performed += 1
        self._inbox.post(lambda: self.spec.on_done(job, report))


class InlineWorkerPool:
    """All workers of a test. Implements `mjplug.contracts.work.WorkerPool`.

    Attributes:
        workers: The workers, by the name of the plugin instance.
    """

    def __init__(self) -> None:
        self.workers: dict[str, InlineWorker] = {}

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> InlineWorker:
        """Opens a work in the calling thread."""
        worker = self.workers[spec.name] = InlineWorker(spec, simulation, inbox)
        return worker

    def prepare(self, model: mujoco.MjModel) -> None:
        """Does nothing, because the works use the model itself."""

    def close(self) -> None:
        """Closes all works."""
        for worker in self.workers.values():
            worker.work.close()
