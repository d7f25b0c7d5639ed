"""A work in a process: its plugin's view of it, and the thread that starts, hears and restarts the process."""

import logging
import os
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import Any

from mjplug.core import snapshot
from mjplug.core.inbox import Inbox
from mjplug.core.simulation import Simulation
from mjplug.log import INSTANCES
from mjplug.wire.dialect import Outlet
from mjplug.work import Health, Job, Order
from mjplug.worker.handover import Handover
from mjplug.worker.messages import Done, Failed, Ready, Setup
from mjplug.worker.process import WorkerProcess
from mjplug.worker.states import SharedStates
from mjplug.worker.watch import Watch

PAUSES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""How long to wait before a process is started again [s]: longer each time, up to the last."""

SHORT_LAG, LONG_LAG = 0.1, 5.0
"""How much later than the server a process may hear of a listener [s]: for a stream, and for what is answered.

It is a millisecond as a rule, and seconds on a busy machine. A stream does not wait so long, because the listener may
be gone again; one of its messages then is missing.
"""

PROVEN = 10.0
"""A process that has run so long [s] was no failure: the next restart is quick again."""


@dataclass(slots=True)
class _Life:
    """How one process fared.

    Attributes:
        reason: Why it ended.
        opened_at: When its work was opened, by `monotonic` [s]; None if it never was.
        hung: Whether it was ended because it hung.
        hopeless: Whether another one in the same environment would come no further.
        lost: The tasks that were lost with it.
    """

    reason: str = ""
    opened_at: float | None = None
    hung: bool = False
    hopeless: bool = False
    lost: frozenset[str] = frozenset()


class ProcessWorker:
    """Implements `mjplug.work.Worker`.

    Attributes:
        health: How it fares.

    Args:
        order: What to do.
        simulation: Where states come from.
        inbox: Through which the order's calls reach the physics thread.
        model: The compiled model, as `mj_saveModel` writes it.
        assignment: The pickled `Assignment`.
        outlets: Those of the order's publishers, here in the server.
    """

    def __init__(
        self,
        order: Order,
        simulation: Simulation,
        inbox: Inbox,
        model: bytes,
        assignment: bytes,
        outlets: Sequence[Outlet],
    ) -> None:
        self._order = order
        self._simulation = simulation
        self._inbox = inbox
        self._model = model
        self._assignment = assignment
        self._outlets = outlets
        self._logger = logging.getLogger(f"{INSTANCES}.{order.name}")
        self._states = SharedStates.create(snapshot.size(simulation.model))
        self._handover = Handover(self._states.slots, partial(snapshot.take, simulation.model, simulation.data))
        self.health = Health(dropped=self._handover.dropped)
        self._closing = threading.Event()
        self._guard = threading.Lock()
        self._process: WorkerProcess | None = None
        # Both threads change it, each time in one call, which Python's lock makes whole.
        self._answered: set[str] = set()
        self._watch: Watch | None = None
        self._hung = ""
        self._ready = False
        self._thread = threading.Thread(target=self._supervise, name=f"worker {order.name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the order."""
        return self._order.name

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
        """Hands over the present state; see `mjplug.work.Worker`."""
        simulation, wanted = self._simulation, frozenset(tasks)
        if answered:
            self._answered.update(wanted)
            for outlet in self._outlets:
                outlet.look()
        if not self._handover.put(simulation.time_ns, simulation.epoch, wanted):
            self._post_lost(wanted, self.health.reason)
        elif self._order.sync:
            # Time stands still in the loop, not here: the loop serves requests meanwhile.
            self._order.hold(True)

    def look(self, now: float) -> None:
        """Ends a process that hangs; `_supervise` then starts another one.

        Args:
            now: By `monotonic` [s].
        """
        with self._guard:
            process, watch = self._process, self._watch
            if process is None or watch is None or self._hung:
                return
            opening = not self._ready
            self._hung = watch.look(now, process if opening else self._handover.under_way, opening)
            self.health.starved = watch.starved
            if self._hung:
                self._note("restarting", self._hung)
                process.kill()

    def hang_up(self) -> None:
        """Asks the process to end, and lets none follow; a second call does nothing."""
        self._closing.set()
        self._handover.close()
        with self._guard:
            if self._process is None:
                return
            if self._ready:
                self._process.hang_up()
            else:
                self._process.kill()

    def end(self, until: float, at_last: float) -> None:
        """Waits until the process and its thread are gone; before it, `hang_up`.

        Args:
            until: When to end it by force, by `monotonic` [s].
            at_last: When to wait no longer, by `monotonic` [s].
        """
        self._thread.join(max(0.0, until - monotonic()))
        if self._thread.is_alive():
            self._kill()
            self._thread.join(max(0.0, at_last - monotonic()))
        if self._thread.is_alive():
            process = self._process
            self._logger.error(
                "the worker process%s does not end although it was killed; the server stops without it",
                "" if process is None else f" {process.pid}",
            )
        self._states.close()

    def _supervise(self) -> None:
        try:
            self._keep_alive()
        except Exception:
            self._logger.exception("the worker process cannot be looked after any more")
            self._give_up("an internal error; see the log")

    def _keep_alive(self) -> None:
        """Keeps one process running until the server stops, or until it is clear that the work cannot be done here."""
        failures, opened_before = 0, False
        while not self._closing.is_set():
            life = self._try_environments()
            if self._closing.is_set():
                return
            if life.hopeless and not opened_before:
                self._logger.warning(
                    "this cannot be done on this machine: %s; the server runs on without it", life.reason
                )
                self._give_up(life.reason)
                return
            lost = life.lost
            if life.opened_at is None:
                # What waited for a process that was open is given one more chance; others would wait for ever.
                lost |= self._handover.disconnect(keep_waiting=False)
            # One that hangs may do so time after time, and long after it was opened.
            proven = life.opened_at is not None and not life.hung and monotonic() - life.opened_at > PROVEN
            opened_before |= life.opened_at is not None
            failures = 1 if proven else failures + 1
            pause = PAUSES[min(failures, len(PAUSES)) - 1]
            self._note("restarting", life.reason)
            self._logger.error("the worker process: %s; it is started again in %g s", life.reason, pause)
            self._lose(lost, life.reason)
            self._closing.wait(pause)
            self.health.restarts += 1

    def _try_environments(self) -> _Life:
        """Runs processes, in one environment after the other, until one has run for which there was hope."""
        reasons: list[str] = []
        environments = self._order.environments
        for changes in environments:
            life = self._live(changes)
            if not life.hopeless or self._closing.is_set():
                return life
            named = ", ".join(f"{name}={value}" for name, value in changes.items() if value)
            reasons.append(f"{named}: {life.reason}" if named and len(environments) > 1 else life.reason)
            self._logger.debug("not available: %s", reasons[-1])
        return _Life("; ".join(reasons), hopeless=True)

    def _live(self, changes: Mapping[str, str]) -> _Life:
        """Runs one process from its start to its end."""
        with self._guard:
            if self._closing.is_set():
                return _Life("the server is stopping")
            try:
                process = self._process = WorkerProcess(changes, self._states.inherited)
            except OSError as error:
                # There may be memory and processes to spare again.
                return _Life(f"it could not be started: {error}")
            watch = self._watch = Watch(process.pid, self._order.job_timeout)
            self._hung = ""
        life = _Life()
        try:
            self._listen(process, watch, life)
        finally:
            # First, since the number of its pipe may be another file's as soon as it is closed.
            life.lost = self._handover.disconnect(keep_waiting=True)
            ended = process.end()
            with self._guard:
                self._process, self._ready = None, False
        if not life.reason:
            life.hung = bool(self._hung)
            life.reason = self._hung or ended
            # A driver that hangs is tried in the next environment; a process that was stopped or killed, once more.
            life.hopeless = life.opened_at is None and (watch.too_long or not process.killed)
        return life

    def _listen(self, process: WorkerProcess, watch: Watch, life: _Life) -> None:
        """Tells a process who it is, and takes what it says to its end."""
        level = self._logger.getEffectiveLevel()
        # In lockstep, physics waits for it anyhow.
        priority = "normal" if self._order.sync else self._order.priority
        setup = Setup(self._order.name, os.getpid(), tuple(sys.path), level, self._states.handle, priority)
        process.begin(setup, self._model, self._assignment)
        while (message := process.receive()) is not None:
            watch.heard()
            match message:
                case logging.LogRecord():
                    self._log(message)
                case Done(report):
                    self._finish(report)
                case Ready(said):
                    life.opened_at = monotonic()
                    self._open(process, said)
                case Failed(reason, hopeless):
                    life.reason, life.hopeless = reason, hopeless

    def _open(self, process: WorkerProcess, said: str) -> None:
        with self._guard:
            self._ready = True
        self._note("running", "")
        self._inbox.post(partial(self._order.on_ready, said))
        outlets, answered = self._outlets, self._answered

        def send(slot: int, job: Job) -> bool:
            lag = SHORT_LAG if answered.isdisjoint(job.tasks) else LONG_LAG
            return process.perform(slot, job, [outlet.matched for outlet in outlets], lag)

        self._handover.connect(send)

    def _finish(self, report: Any) -> None:
        job = self._handover.finish()
        if job is not None:
            self.health.performed += 1
            self._answered.difference_update(job.tasks)
            self._inbox.post(partial(self._order.on_done, job, report))
        self._let_go()

    def _log(self, record: logging.LogRecord) -> None:
        logger = logging.getLogger(record.name)
        if logger.isEnabledFor(record.levelno):
            logger.handle(record)

    def _give_up(self, reason: str) -> None:
        self._note("unavailable", reason)
        self._post_lost(self._handover.close(), reason)
        self._let_go()

    def _lose(self, tasks: frozenset[str], reason: str) -> None:
        if tasks:
            self._post_lost(tasks, reason)
        self._let_go()

    def _let_go(self) -> None:
        """Lets simulated time go on if nothing is left to do; after what the plugin is to hear of it."""
        if self._order.sync:
            self._inbox.post(self._settle)

    def _settle(self) -> None:
        if self._handover.settled:
            self._order.hold(False)

    def _post_lost(self, tasks: frozenset[str], reason: str) -> None:
        self._answered.difference_update(tasks)
        self._inbox.post(partial(self._order.on_lost, tasks, reason))

    def _note(self, state: str, reason: str) -> None:
        self.health.state, self.health.reason = state, reason

    def _kill(self) -> None:
        with self._guard:
            if self._process is not None:
                self._process.kill()
