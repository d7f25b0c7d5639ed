"""All worker processes of a server."""

import pickle
import threading
from time import monotonic
from typing import Any

import mujoco
import numpy as np

from mjplug.core.inbox import Inbox
from mjplug.core.simulation import Simulation
from mjplug.errors import PluginError
from mjplug.transport import Publisher
from mjplug.wire.publisher import WirePublisher
from mjplug.wire.session import SessionSettings
from mjplug.work import Order
from mjplug.worker.performer import Assignment
from mjplug.worker.watch import LOOK
from mjplug.worker.worker import ProcessWorker

_PARTING = 1.0
"""How long processes may take to end by themselves [s]."""

_FORCE = 0.5
"""How long they may take to end when they have been killed [s]."""


class ProcessWorkers:
    """Implements `mjplug.work.Workers`: one process per order.

    Args:
        session: The server's settings of the network, which its processes use too.
        endpoints: Where they join it, the first choice first.
    """

    def __init__(self, session: SessionSettings, endpoints: tuple[str, ...]) -> None:
        self._session = session
        self._endpoints = endpoints
        self._model = b""
        self._workers: list[ProcessWorker] = []
        self._closing = threading.Event()
        self._watching: threading.Thread | None = None

    def start(self, order: Order, simulation: Simulation, inbox: Inbox) -> ProcessWorker:
        """Starts a process; see `mjplug.work.Workers`.

        Raises:
            PluginError: The work does not pickle, or a publisher is not of this server.
        """
        publishers = [_own(order.name, publisher) for publisher in order.publishers]
        leases = tuple(publisher.lease() for publisher in publishers)
        try:
            assignment = pickle.dumps(Assignment(order.work, leases, self._session, self._endpoints))
        except Exception as error:
            # Whatever its author put into it.
            kind = type(order.work).__name__
            raise PluginError(f"the work {kind} of {order.name} cannot be sent to a process: {error}") from error
        # Saved once, however many processes are started.
        self._model = self._model or _saved(simulation.model)
        outlets = [outlet for publisher in publishers for outlet in publisher.outlets]
        worker = ProcessWorker(order, simulation, inbox, self._model, assignment, outlets)
        self._workers.append(worker)
        if self._watching is None:
            self._watching = threading.Thread(target=self._watch, name="worker watch", daemon=True)
            self._watching.start()
        return worker

    def close(self) -> None:
        """Ends all processes, those that hang by force; a second call does nothing. It takes 1.5 s at most."""
        self._closing.set()
        for worker in self._workers:
            worker.hang_up()
        until = monotonic() + _PARTING
        for worker in self._workers:
            worker.end(until, until + _FORCE)
        self._workers.clear()

    def _watch(self) -> None:
        while not self._closing.wait(LOOK):
            for worker in tuple(self._workers):
                worker.look(monotonic())


def _own(name: str, publisher: Publisher[Any]) -> WirePublisher[Any]:
    if not isinstance(publisher, WirePublisher):
        raise PluginError(f"{name}: a work publishes to publishers of the server, not to {type(publisher).__name__}")
    return publisher


def _saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty((mujoco.mj_sizeModel(model), 1), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
