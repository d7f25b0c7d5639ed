"""All worker processes of a server."""

import pickle
import threading
from functools import partial
from time import monotonic
from typing import Any

import mujoco
import numpy as np

from mjplug.contracts.transport import BytesPublisher, Publisher
from mjplug.contracts.work import WorkerSpec
from mjplug.errors import PluginError
from mjplug.log_scope import bound
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug.wire.bytes_endpoints import WireBytesPublisher
from mjplug.wire.publisher import WirePublisher
from mjplug.wire.session import SessionSettings
from mjplug.worker.child_runner import ChildSetup
from mjplug.worker.hang_detector import CHECK_INTERVAL
from mjplug.worker.supervisor import WorkerSupervisor

_EXIT_GRACE = 1.0
"""Time for processes to end by themselves before they are killed [s]."""

_KILL_WAIT = 0.5
"""Time for killed processes to end [s]."""


class ProcessWorkerPool:
    """Implements `mjplug.contracts.work.WorkerPool`: one process per spec.

    Args:
        session: The server's session settings, which the worker processes use too.
        endpoints: Endpoints of the server's network, preferred first.
    """

    def __init__(self, session: SessionSettings, endpoints: tuple[str, ...]) -> None:
        self._session = session
        self._endpoints = endpoints
        self._model: tuple[mujoco.MjModel, memoryview] | None = None
        self._saving = threading.Lock()
        self._workers: list[WorkerSupervisor] = []
        self._closing = threading.Event()
        self._checking: threading.Thread | None = None

    @property
    def running(self) -> int:
        """Number of workers that have not ended."""
        return len(self._workers)

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> WorkerSupervisor:
        """Starts a process; see `mjplug.contracts.work.WorkerPool`.

        Raises:
            PluginError: The work cannot be pickled, or a publisher is not from this server.
        """
        publishers = [_own(spec.name, publisher) for publisher in spec.publishers]
        specs = tuple(publisher.remote_spec() for publisher in publishers)
        try:
            setup = pickle.dumps(ChildSetup(spec.work, specs, self._session, self._endpoints))
        except Exception as error:
            # Any exception, because pickling runs code of the plugin.
            kind = type(spec.work).__name__
            raise PluginError(f"{spec.name}: the work {kind} cannot be pickled: {error}") from error
        if not spec.save_later:
            self._saved(simulation.model)
        writers = [writer for publisher in publishers for writer in publisher.writers]
        worker = WorkerSupervisor(spec, simulation, inbox, partial(self._saved, simulation.model), setup, writers)
        self._workers.append(worker)
        if self._checking is None:
            self._checking = threading.Thread(target=bound(self._check), name="worker checks", daemon=True)
            self._checking.start()
        return worker

    def prepare(self, model: mujoco.MjModel) -> None:
        """Saves a changed model if there are processes; see `mjplug.contracts.work.WorkerPool`."""
        if self._workers:
            self._saved(model)

    def close(self) -> None:
        """Stops all processes, and kills those that hang; takes at most 1.5 s. A second call does nothing."""
        self._closing.set()
        for worker in tuple(self._workers):
            worker.request_stop()
        kill_at = monotonic() + _EXIT_GRACE
        for worker in tuple(self._workers):
            worker.end(kill_at, kill_at + _KILL_WAIT)
        if self._checking is not None:
            self._checking.join()
        self._workers.clear()

    def _check(self) -> None:
        while not self._closing.wait(CHECK_INTERVAL):
            for worker in tuple(self._workers):
                if worker.stopped:
                    self._end(worker)
                else:
                    worker.check(monotonic())

    def _end(self, worker: WorkerSupervisor) -> None:
        worker.request_stop()
        until = monotonic() + _EXIT_GRACE
        worker.end(until, until + _KILL_WAIT)
        self._workers.remove(worker)

    def _saved(self, model: mujoco.MjModel) -> memoryview:
        """Returns the saved model; the last one is kept, for all processes."""
        with self._saving:
            if self._model is None or self._model[0] is not model:
                self._model = model, _model_bytes(model)
            return self._model[1]


def _own(name: str, publisher: Publisher[Any] | BytesPublisher) -> WirePublisher[Any] | WireBytesPublisher:
    if not isinstance(publisher, WirePublisher | WireBytesPublisher):
        raise PluginError(
            f"{name}: a work needs publishers from host.create_publisher, not a {type(publisher).__name__}"
        )
    return publisher


def _model_bytes(model: mujoco.MjModel) -> memoryview:
    buffer = np.empty((mujoco.mj_sizeModel(model), 1), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    # Not copied, because a copy of a large model would hold Python's global interpreter lock for milliseconds.
    return buffer.reshape(-1).data
