"""Starts the view's worker process when somebody looks, gives it a state per frame, and ends it afterwards."""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

from mjplug.contracts.transport import BytesPublisher
from mjplug.contracts.work import Job, Worker, WorkerPool, WorkerSpec
from mjplug.physics.body_spring import Grip
from mjplug.physics.loop import Loop
from mjplug.physics.model_change import ModelChange
from mjplug.services.view.overlays import PERTURBATION
from mjplug.services.view.work import MODEL, SCENE, STREAMS, Context, Report, ViewWork

FRAME_PERIOD = 1.0 / 60.0
"""Minimum wall time between two frames [s]."""

STILL_PERIOD = 1.0
"""Wall time between two frames of a state that does not change [s], for clients that join late."""

LINGER = 10.0
"""The worker process ends when nobody has looked for this wall time [s]."""


class Feed:
    """The view's worker and its states. Physics thread only.

    While there is no subscriber, there is no worker process and no timer. Frames are due in wall time, so they are sent
    while the simulation is paused, and no more than 60 per second at any speed.

    Args:
        loop: The physics loop.
        workers: Runs the worker process.
        open_publisher: Declares the publisher of one of `STREAMS`; it also gets the function to call for the first
            subscriber.
        grips: Returns what viewers drag.
        on_made: Called with the drawing pack and with the saved model when they have been made.
        on_lost: Called with the task and the reason when one of them cannot be made.
    """

    def __init__(
        self,
        loop: Loop,
        workers: WorkerPool,
        open_publisher: Callable[[str, Callable[[], None]], BytesPublisher],
        grips: Callable[[], tuple[Grip, ...]],
        on_made: Callable[[Report], None],
        on_lost: Callable[[str, str], None],
    ) -> None:
        self._loop = loop
        self._workers = workers
        self._grips = grips
        self._on_made = on_made
        self._on_lost = on_lost
        self._timer = loop.wall_timers.create(self._tick)
        self._worker: Worker | None = None
        self._used = 0.0
        self._sent = 0.0
        self._last: object = None
        self._requested: set[str] = set()
        self._publishers = {name: open_publisher(name, lambda: loop.inbox.post(self._matched)) for name in STREAMS}

    @property
    def running(self) -> bool:
        """Whether there is a worker process."""
        return self._worker is not None

    def request(self, task: str) -> None:
        """Lets the worker make the drawing pack (`work.SCENE`) or save the model (`work.MODEL`)."""
        self._used = perf_counter()
        self._requested.add(task)
        self._started().submit((task,), context=self._context(()))
        if self._timer.due > self._used + LINGER:
            self._timer.set(self._used + LINGER)

    def model_changed(self, change: ModelChange) -> None:
        """Ends the worker of the previous model, and requests again what clients wait for."""
        requested, self._requested = self._requested, set()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
        self._last = None
        for task in requested:
            self.request(task)
        if any(publisher.matched for publisher in self._publishers.values()):
            self._timer.set(perf_counter())

    def _matched(self) -> None:
        self._last = None
        self._timer.set(perf_counter())

    def _tick(self, now: float) -> None:
        wanted = [name for name, publisher in self._publishers.items() if publisher.matched]
        if wanted and not self._unavailable():
            self._used = now
            self._send(now, wanted)
            self._timer.set(now + FRAME_PERIOD)
        elif self._requested:
            # On a busy machine, making the drawing pack of a large model takes longer than `LINGER`.
            self._timer.set(now + LINGER)
        elif now - self._used < LINGER:
            self._timer.set(self._used + LINGER)
        elif self._worker is not None:
            self._worker.stop()
            self._worker = None

    def _send(self, now: float, wanted: list[str]) -> None:
        """Submits the present state for some streams if it has changed, or if the last one is `STILL_PERIOD` old."""
        context = self._context(wanted)
        state = *self._state(), context
        if state == self._last and now - self._sent < STILL_PERIOD:
            return
        self._last, self._sent = state, now
        self._started().submit(wanted, context=context)

    def _context(self, wanted: Sequence[str]) -> Context:
        grips = self._grips() if f"overlay/{PERTURBATION}" in wanted else ()
        return self._loop.paused, grips, self._loop.simulation.step

    def _state(self) -> tuple[object, ...]:
        """Returns a value that changes with the poses."""
        loop, simulation = self._loop, self._loop.simulation
        if not loop.paused:
            return simulation.step, simulation.epoch
        # While paused, requests may set positions without a step.
        data = simulation.data
        positions = data.qpos.tobytes(), data.mocap_pos.tobytes(), data.mocap_quat.tobytes()
        return simulation.step, simulation.epoch, positions

    def _unavailable(self) -> bool:
        """Returns whether the worker cannot run; after `LINGER`, the next subscriber starts another one."""
        return self._worker is not None and self._worker.status.state == "unavailable"

    def _started(self) -> Worker:
        if self._worker is None:
            generation = self._loop.simulation.generation
            spec = WorkerSpec(
                "view",
                ViewWork(),
                tuple(self._publishers.values()),
                save_later=True,
                on_done=lambda job, reports: self._done(generation, job, reports),
                on_lost=lambda tasks, reason: self._lost(generation, tasks, reason),
            )
            self._worker = self._workers.start(spec, self._loop.simulation, self._loop.inbox)
        return self._worker

    def _done(self, generation: int, job: Job, reports: Any) -> None:
        if generation != self._loop.simulation.generation:
            # Of a worker of the previous model.
            return
        self._made(job.tasks)
        for report in reports:
            self._on_made(report)

    def _lost(self, generation: int, tasks: frozenset[str], reason: str) -> None:
        if generation != self._loop.simulation.generation:
            return
        self._made(tasks)
        for task in (SCENE, MODEL):
            if task in tasks:
                self._on_lost(task, reason)

    def _made(self, tasks: frozenset[str]) -> None:
        if not self._requested.isdisjoint(tasks):
            self._requested -= tasks
            self._used = perf_counter()
