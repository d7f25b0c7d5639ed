"""A transport without a network, and workers without processes.

Tests send messages and requests by hand and read what came out.
"""

import copy
import logging
import pickle
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import mujoco
import numpy as np

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import QoS, ServiceName, Topic
from mjplug.contracts.work import Job, UnavailableError, WorkerSpec, WorkerStatus
from mjplug.physics import snapshot
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug_schemas.message import Message


class FakeCall:
    """A request and, once it is there, its answer."""

    def __init__(self, request: Message, parameters: Mapping[str, str]) -> None:
        self.request = request
        self.parameters = parameters
        self.response: Any = None
        self.refusal: str | None = None
        self.answers = 0

    @property
    def answered(self) -> bool:
        return self.answers > 0

    def respond(self, response: Message) -> None:
        if not self.answered:
            self.response = response
        self.answers += 1

    def refuse(self, reason: str) -> None:
        if not self.answered:
            self.refusal = reason
        self.answers += 1


class FakePublisher:
    """Keeps what was published."""

    def __init__(self, on_matched: Callable[[], None] | None) -> None:
        self.matched = True
        self.messages: list[Any] = []
        self.on_matched = on_matched

    def publish(self, message: Message) -> None:
        self.messages.append(message)

    def publish_frame(self, frame: CdrFrame) -> None:
        self.messages.append(frame.type.from_cdr(frame.payload()))


class FakeTransport:
    """Endpoints by their full ROS names."""

    def __init__(self) -> None:
        self.publishers: dict[str, FakePublisher] = {}
        self.types: dict[str, type] = {}
        self.qos: dict[str, QoS] = {}
        self._subscriptions: dict[str, list[Callable[[Any], None]]] = defaultdict(list)
        self._services: dict[str, Callable[[Any], None]] = {}

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> FakePublisher:
        self.publishers[topic.name] = FakePublisher(on_matched)
        self.types[topic.name], self.qos[topic.name] = topic.type, topic.qos
        return self.publishers[topic.name]

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        self._subscriptions[topic.name].append(deliver)
        self.types[topic.name] = topic.type

    def open_service(self, service: ServiceName, deliver: Callable[[Any], None]) -> None:
        self._services[service.name] = deliver
        self.types[service.name] = service.type

    @property
    def services(self) -> set[str]:
        return set(self._services)

    @property
    def subscriptions(self) -> set[str]:
        return set(self._subscriptions)

    def send(self, name: str, message: Message) -> None:
        for deliver in self._subscriptions[name]:
            deliver(message)

    def call(self, name: str, request: Message | None = None, **parameters: str) -> FakeCall:
        call = FakeCall(request if request is not None else self.types[name].Request(), parameters)
        self._services[name](call)
        return call


class InlineWorker:
    """Does the work at once, in the thread that asks; `hold` lets jobs wait as those of a busy process do."""

    def __init__(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> None:
        self.status = WorkerStatus()
        self.spec = spec
        self._simulation = simulation
        self._inbox = inbox
        self._hold = False
        self._waiting: tuple[Job, np.ndarray] | None = None
        model = copy.copy(simulation.model)
        self._model, self._data = model, mujoco.MjData(model)
        # As on the way to a process.
        self.work = pickle.loads(pickle.dumps(spec.work))
        try:
            said = self.work.open(model, spec.publishers, logging.getLogger("worker"))
        except UnavailableError as error:
            self.status.state, self.status.reason = "unavailable", str(error)
            inbox.post(lambda: spec.on_lost(frozenset(), self.status.reason))
        else:
            self.status.state = "running"
            inbox.post(lambda: spec.on_ready(said))

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
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
        self._waiting = Job(simulation.time_ns, simulation.epoch, wanted), state
        if not self._hold:
            self._perform()

    def hold(self) -> None:
        self._hold = True

    def release(self) -> None:
        self._hold = False
        if self._waiting is not None:
            self._perform()

    def _perform(self) -> None:
        job, state = self._waiting
        self._waiting = None
        snapshot.load(self._model, self._data, state)
        report = pickle.loads(pickle.dumps(self.work.perform(self._data, job)))
        self.status.performed += 1
        self._inbox.post(lambda: self.spec.on_done(job, report))


class InlineWorkers:
    """Keeps its workers by the name of the plugin instance."""

    def __init__(self) -> None:
        self.workers: dict[str, InlineWorker] = {}

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> InlineWorker:
        worker = self.workers[spec.name] = InlineWorker(spec, simulation, inbox)
        return worker

    def close(self) -> None:
        for worker in self.workers.values():
            worker.work.close()
