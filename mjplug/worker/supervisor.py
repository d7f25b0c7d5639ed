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

from mjplug.contracts.work import Job, WorkerSpec, WorkerStatus
from mjplug.log import INSTANCES
from mjplug.log_scope import bound, logger_of_server
from mjplug.physics import snapshot
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug.wire.dialect import KeyWriter
from mjplug.worker.handover import Handover
from mjplug.worker.hang_detector import HangDetector
from mjplug.worker.messages import ChildEnvironment, Done, Failed, Ready
from mjplug.worker.process import WorkerProcess
from mjplug.worker.states import SharedStates

RESTART_DELAYS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""How long to wait before a process is started again [s]: longer each time, up to the last."""

MATCH_WAIT, ANSWERED_MATCH_WAIT = 0.1, 5.0
"""How much later than the server a process may hear of a listener [s]: for a stream, and for what is answered.

It is a millisecond as a rule, and seconds on a busy machine. A stream does not wait so long, because the listener may
be gone again; one of its messages then is missing.
"""

STABLE_AFTER = 10.0
"""A process that has run so long [s] was no failure: the next restart is quick again."""


@dataclass(slots=True)
class _Run:
    """How one process fared.

    Attributes:
        reason: Why it ended.
        opened_at: When its work was opened, by `monotonic` [s]; None if it never was.
        hung: Whether it was ended because it hung.
        permanent: Whether another one in the same environment would come no further.
        lost: The tasks that were lost with it.
    """

    reason: str = ""
    opened_at: float | None = None
    hung: bool = False
    permanent: bool = False
    lost: frozenset[str] = frozenset()


class WorkerSupervisor:
    """Implements `mjplug.contracts.work.Worker`.

    Attributes:
        health: How it fares.

    Args:
        spec: What it does.
        simulation: Where states come from.
        inbox: Through which the order's calls reach the physics thread.
        model: The compiled model, as `mj_saveModel` writes it.
        setup: The pickled `ChildSetup`.
        writers: Those of the order's publishers, here in the server.
    """

    def __init__(
        self,
        spec: WorkerSpec,
        simulation: Simulation,
        inbox: Inbox,
        model: bytes,
        setup: bytes,
        writers: Sequence[KeyWriter],
    ) -> None:
        self._spec = spec
        self._simulation = simulation
        self._inbox = inbox
        self._model = model
        self._setup = setup
        self._writers = writers
        self._logger = logger_of_server(f"{INSTANCES}.{spec.name}")
        self._states = SharedStates.create(snapshot.size(simulation.model))
        self._handover = Handover(self._states.slots, partial(snapshot.take, simulation.model, simulation.data))
        self.status = WorkerStatus(dropped=self._handover.dropped)
        self._closing = threading.Event()
        self._guard = threading.Lock()
        self._process: WorkerProcess | None = None
        # Both threads change it, each time in one call, which Python's lock makes whole.
        self._answered: set[str] = set()
        self._detector: HangDetector | None = None
        self._hung = ""
        self._ready = False
        self._thread = threading.Thread(target=bound(self._supervise), name=f"worker {spec.name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the spec."""
        return self._spec.name

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
        """Hands over the present state; see `mjplug.contracts.work.Worker`."""
        simulation, wanted = self._simulation, frozenset(tasks)
        if answered:
            self._answered.update(wanted)
            for writer in self._writers:
                writer.look()
        if not self._handover.put(simulation.time_ns, simulation.epoch, wanted):
            self._post_lost(wanted, self.status.reason)
        elif self._spec.sync:
            # Time stands still in the loop, not here: the loop serves requests meanwhile.
            self._spec.hold(True)

    def check(self, now: float) -> None:
        """Ends a process that hangs; `_supervise` then starts another one.

        Args:
            now: By `monotonic` [s].
        """
        with self._guard:
            process, detector = self._process, self._detector
            if process is None or detector is None or self._hung:
                return
            opening = not self._ready
            self._hung = detector.check(now, process if opening else self._handover.under_way, opening)
            self.status.starved = detector.starved
            if self._hung:
                self._set_state("restarting", self._hung)
                process.kill()

    def request_stop(self) -> None:
        """Asks the process to end, and lets none follow; a second call does nothing."""
        self._closing.set()
        self._handover.close()
        with self._guard:
            if self._process is None:
                return
            if self._ready:
                self._process.close_input()
            else:
                self._process.kill()

    def end(self, until: float, at_last: float) -> None:
        """Waits until the process and its thread are gone; before it, `request_stop`.

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
            run = self._try_environments()
            if self._closing.is_set():
                return
            if run.permanent and not opened_before:
                self._logger.warning(
                    "this cannot be done on this machine: %s; the server runs on without it", run.reason
                )
                self._give_up(run.reason)
                return
            lost = run.lost
            if run.opened_at is None:
                # What waited for a process that was open is given one more chance; others would wait for ever.
                lost |= self._handover.disconnect(keep_waiting=False)
            # One that hangs may do so time after time, and long after it was opened.
            stable = run.opened_at is not None and not run.hung and monotonic() - run.opened_at > STABLE_AFTER
            opened_before |= run.opened_at is not None
            failures = 1 if stable else failures + 1
            pause = RESTART_DELAYS[min(failures, len(RESTART_DELAYS)) - 1]
            self._set_state("restarting", run.reason)
            self._logger.error("the worker process: %s; it is started again in %g s", run.reason, pause)
            self._lose(lost, run.reason)
            self._closing.wait(pause)
            self.status.restarts += 1

    def _try_environments(self) -> _Run:
        """Runs processes, in one environment after the other, until one has run for which there was hope."""
        reasons: list[str] = []
        environments = self._spec.environments
        for changes in environments:
            run = self._run_process(changes)
            if not run.permanent or self._closing.is_set():
                return run
            named = ", ".join(f"{name}={value}" for name, value in changes.items() if value)
            reasons.append(f"{named}: {run.reason}" if named and len(environments) > 1 else run.reason)
            self._logger.debug("not available: %s", reasons[-1])
        return _Run("; ".join(reasons), permanent=True)

    def _run_process(self, changes: Mapping[str, str]) -> _Run:
        """Runs one process from its start to its end."""
        with self._guard:
            if self._closing.is_set():
                return _Run("the server is stopping")
            try:
                process = self._process = WorkerProcess(changes, self._states.inherited)
            except OSError as error:
                # There may be memory and processes to spare again.
                return _Run(f"it could not be started: {error}")
            detector = self._detector = HangDetector(process.pid, self._spec.job_timeout)
            self._hung = ""
        run = _Run()
        try:
            self._listen(process, detector, run)
        finally:
            # First, since the number of its pipe may be another file's as soon as it is closed.
            run.lost = self._handover.disconnect(keep_waiting=True)
            ended = process.end()
            with self._guard:
                self._process, self._ready = None, False
        if not run.reason:
            run.hung = bool(self._hung)
            run.reason = self._hung or ended
            # A driver that hangs is tried in the next environment; a process that was stopped or killed, once more.
            run.permanent = run.opened_at is None and (detector.too_long or not process.killed)
        return run

    def _listen(self, process: WorkerProcess, detector: HangDetector, run: _Run) -> None:
        """Tells a process who it is, and takes what it says to its end."""
        level = self._logger.getEffectiveLevel()
        # In lockstep, physics waits for it anyhow.
        priority = "normal" if self._spec.sync else self._spec.priority
        environment = ChildEnvironment(
            self._spec.name, os.getpid(), tuple(sys.path), level, self._states.handle, priority
        )
        process.begin(environment, self._model, self._setup)
        while (message := process.receive()) is not None:
            detector.message_received()
            match message:
                case logging.LogRecord():
                    self._log(message)
                case Done(report):
                    self._finish(report)
                case Ready(said):
                    run.opened_at = monotonic()
                    self._open(process, said)
                case Failed(reason, permanent):
                    run.reason, run.permanent = reason, permanent

    def _open(self, process: WorkerProcess, said: str) -> None:
        with self._guard:
            self._ready = True
        self._set_state("running", "")
        self._inbox.post(partial(self._spec.on_ready, said))
        writers, answered = self._writers, self._answered

        def send(slot: int, job: Job) -> bool:
            lag = MATCH_WAIT if answered.isdisjoint(job.tasks) else ANSWERED_MATCH_WAIT
            return process.perform(slot, job, [writer.matched for writer in writers], lag)

        self._handover.connect(send)

    def _finish(self, report: Any) -> None:
        job = self._handover.finish()
        if job is not None:
            self.status.performed += 1
            self._answered.difference_update(job.tasks)
            self._inbox.post(partial(self._spec.on_done, job, report))
        self._resume_if_settled()

    def _log(self, record: logging.LogRecord) -> None:
        logger = logging.getLogger(record.name)
        if logger.isEnabledFor(record.levelno):
            logger.handle(record)

    def _give_up(self, reason: str) -> None:
        self._set_state("unavailable", reason)
        self._post_lost(self._handover.close(), reason)
        self._resume_if_settled()

    def _lose(self, tasks: frozenset[str], reason: str) -> None:
        if tasks:
            self._post_lost(tasks, reason)
        self._resume_if_settled()

    def _resume_if_settled(self) -> None:
        """Lets simulated time go on if nothing is left to do; after what the plugin is to hear of it."""
        if self._spec.sync:
            self._inbox.post(self._settle)

    def _settle(self) -> None:
        if self._handover.settled:
            self._spec.hold(False)

    def _post_lost(self, tasks: frozenset[str], reason: str) -> None:
        self._answered.difference_update(tasks)
        self._inbox.post(partial(self._spec.on_lost, tasks, reason))

    def _set_state(self, state: str, reason: str) -> None:
        self.status.state, self.status.reason = state, reason

    def _kill(self) -> None:
        with self._guard:
            if self._process is not None:
                self._process.kill()
