"""Supervises the worker process of one work: starts it, sends it jobs, reads its messages, and restarts it.

Three threads of the server take part:
- The supervisor's own thread (`_supervise`) starts the process, reads its messages and restarts it.
- The physics thread calls `submit`. Callbacks of the plugin are posted to it through the inbox.
- The pool's thread calls `check` once a second.
"""

import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import Any

from mjplug.contracts.work import Job, WorkerSpec, WorkerStatus
from mjplug.log import INSTANCES
from mjplug.log_scope import bound, logger_of_server
from mjplug.model import engine_plugins
from mjplug.physics import snapshot
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug.wire.dialect import KeyWriter
from mjplug.worker.hang_detector import HangDetector
from mjplug.worker.job_slots import JobSlots
from mjplug.worker.messages import ChildEnvironment, Done, Failed, Ready
from mjplug.worker.process import WorkerProcess
from mjplug.worker.states import SharedStates

RESTART_DELAYS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""Delays before the first, second, … restart of a process [s]; further restarts use the last one."""

MATCH_WAIT, AWAITED_MATCH_WAIT = 0.1, 5.0
"""Maximum time that the process waits before a job until it has matched the same subscribers as the server [s].

The first value is for a job that no client waits for, the second one for a job whose client gets a response. Zenoh
matches the subscribers of the server and of the process independently, usually within a millisecond, but within seconds
on a busy machine. The first value is short, because the subscriber may already be closed; a new subscriber may then
miss one message.
"""

STABLE_AFTER = 10.0
"""If a process has run for this time [s], the next restart uses the first delay again."""


@dataclass(slots=True)
class _Run:
    """The run of one process, from its start to its end.

    Attributes:
        reason: Why the process ended.
        opened_at: Time by `monotonic` at which the work was opened [s]; None if it was not.
        hung: Whether the process was killed because it hung; see `HangDetector`.
        permanent: Whether another process in the same environment would fail too.
        lost: The tasks that were lost with the process.
    """

    reason: str = ""
    opened_at: float | None = None
    hung: bool = False
    permanent: bool = False
    lost: frozenset[str] = frozenset()


class WorkerSupervisor:
    """Implements `mjplug.contracts.work.Worker`.

    Attributes:
        status: State and counters.
        stopped: Whether `stop` was called; the pool then ends the process.

    Args:
        spec: The work and its settings.
        simulation: The simulation whose state `submit` copies.
        inbox: The inbox of the physics thread, on which the callbacks of the spec run.
        model: Returns the compiled model in the format of `mj_saveModel`; called on the worker's own thread.
        setup: The pickled `ChildSetup`: the work, its publishers and the session settings.
        writers: The Zenoh publishers of the spec's publishers in the server's process, one for each key.
    """

    def __init__(
        self,
        spec: WorkerSpec,
        simulation: Simulation,
        inbox: Inbox,
        model: Callable[[], memoryview],
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
        self._jobs = JobSlots(self._states.slots, partial(snapshot.take, simulation.model, simulation.data))
        self.stopped = False
        self.status = WorkerStatus(dropped=self._jobs.dropped)
        self._closing = threading.Event()
        # Guards `_process`, `_detector`, `_hung` and `_ready`.
        self._lock = threading.Lock()
        self._process: WorkerProcess | None = None
        # The tasks for which a client waits. Two threads change the set, each time in one atomic call.
        self._awaited: set[str] = set()
        self._detector: HangDetector | None = None
        # Why the process hung; empty if it did not.
        self._hung = ""
        self._ready = False
        self._thread = threading.Thread(target=bound(self._supervise), name=f"worker {spec.name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the spec."""
        return self._spec.name

    def submit(self, tasks: Iterable[str], answered: bool = False, context: Any = None) -> None:
        """Submits a job with the current state; see `mjplug.contracts.work.Worker`."""
        simulation, names = self._simulation, frozenset(tasks)
        if answered:
            self._awaited.update(names)
            for writer in self._writers:
                writer.refresh_matched()
        if not self._jobs.put(simulation.time_ns, simulation.epoch, names, context, simulation.lineage):
            self._post_lost(names, self.status.reason)
        elif self._spec.sync:
            # This does not wait here: the loop takes no steps, but serves requests.
            self._spec.block_steps(True)

    def stop(self) -> None:
        """Lets the pool end the process within its next check; see `mjplug.contracts.work.Worker`."""
        self.stopped = True

    def check(self, now: float) -> None:
        """Kills the process if it hangs; `_supervise` then restarts it.

        Args:
            now: Time by `monotonic` [s].
        """
        with self._lock:
            process, detector = self._process, self._detector
            if process is None or detector is None or self._hung:
                return
            opening = not self._ready
            self._hung = detector.check(now, process if opening else self._jobs.running, opening)
            self.status.starved = detector.starved
            if self._hung:
                self._set_state("restarting", self._hung)
                process.kill()

    def request_stop(self) -> None:
        """Asks the process to end, and prevents a restart; a second call does nothing."""
        self._closing.set()
        self._jobs.close()
        with self._lock:
            if self._process is None:
                return
            if self._ready:
                self._process.close_input()
            else:
                self._process.kill()

    def end(self, kill_at: float, give_up_at: float) -> None:
        """Waits until the process and its thread have ended; call `request_stop` first.

        Args:
            kill_at: Time by `monotonic` at which the process is killed [s].
            give_up_at: Time by `monotonic` at which waiting ends [s].
        """
        self._thread.join(max(0.0, kill_at - monotonic()))
        if self._thread.is_alive():
            self._kill()
            self._thread.join(max(0.0, give_up_at - monotonic()))
        if self._thread.is_alive():
            process = self._process
            self._logger.error(
                "the worker process%s was killed, but has not ended; the server stops without waiting for it",
                "" if process is None else f" {process.pid}",
            )
        self._states.close()

    def _supervise(self) -> None:
        try:
            self._keep_alive()
        except Exception:
            self._logger.exception("supervising the worker process failed")
            self._set_unavailable("internal error; see the log")

    def _keep_alive(self) -> None:
        """Keeps one process running until the server stops, or until the work proves unavailable on this machine."""
        failures, opened_before = 0, False
        while not self._closing.is_set():
            run = self._try_environments()
            if self._closing.is_set():
                return
            if run.permanent and not opened_before:
                self._logger.warning(
                    "the work is unavailable on this machine: %s; the server continues without it", run.reason
                )
                self._set_unavailable(run.reason)
                return
            lost = run.lost
            if run.opened_at is None:
                # A job that waited for an open process is kept for one more process; otherwise it could wait for ever.
                lost |= self._jobs.disconnect(keep_waiting=False)
            # A process that hung does not count as stable, because it may hang again and again.
            stable = run.opened_at is not None and not run.hung and monotonic() - run.opened_at > STABLE_AFTER
            opened_before |= run.opened_at is not None
            # The delays grow with the failures in succession.
            failures = 1 if stable else failures + 1
            delay = RESTART_DELAYS[min(failures, len(RESTART_DELAYS)) - 1]
            self._set_state("restarting", run.reason)
            self._logger.error("the worker process failed: %s; it is restarted in %g s", run.reason, delay)
            self._report_lost(lost, run.reason)
            self._closing.wait(delay)
            self.status.restarts += 1

    def _try_environments(self) -> _Run:
        """Runs a process in one environment after the other, until one does not fail permanently; returns that run."""
        reasons: list[str] = []
        environments = self._spec.environments
        for variables in environments:
            run = self._run_process(variables)
            if not run.permanent or self._closing.is_set():
                return run
            named = ", ".join(f"{name}={value}" for name, value in variables.items() if value)
            reasons.append(f"{named}: {run.reason}" if named and len(environments) > 1 else run.reason)
            self._logger.debug("not available: %s", reasons[-1])
        return _Run("; ".join(reasons), permanent=True)

    def _run_process(self, variables: Mapping[str, str]) -> _Run:
        """Runs one process from its start to its end.

        Args:
            variables: Environment variables that the process gets in addition; an empty value removes a variable.
        """
        with self._lock:
            if self._closing.is_set():
                return _Run("the server is stopping")
            try:
                process = self._process = WorkerProcess(variables, self._states.inherited)
            except OSError as error:
                # Not permanent, because memory or processes may become available again.
                return _Run(f"starting it failed: {error}")
            detector = self._detector = HangDetector(process.pid, self._spec.job_timeout)
            self._hung = ""
        run = _Run()
        try:
            self._read_messages(process, detector, run)
        finally:
            # First, because the file descriptor of the pipe may be reused as soon as it is closed.
            run.lost = self._jobs.disconnect(keep_waiting=True)
            ended = process.end()
            with self._lock:
                self._process, self._ready = None, False
        if not run.reason:
            run.hung = bool(self._hung)
            run.reason = self._hung or ended
            # If opening the work hangs, the next environment is tried; a killed process is restarted in the same one.
            run.permanent = run.opened_at is None and (detector.too_long or not process.killed)
        return run

    def _read_messages(self, process: WorkerProcess, detector: HangDetector, run: _Run) -> None:
        """Sends a process its setup, and handles its messages until it ends."""
        level = self._logger.getEffectiveLevel()
        # In lockstep, physics waits for the process, so a low priority has no advantage.
        priority = "normal" if self._spec.sync else self._spec.priority
        environment = ChildEnvironment(
            self._spec.name,
            os.getpid(),
            tuple(sys.path),
            level,
            self._states.handle,
            priority,
            engine_plugins.loaded(),
        )
        process.begin(environment, self._model(), self._setup)
        while (message := process.receive()) is not None:
            detector.message_received()
            match message:
                case logging.LogRecord():
                    self._log(message)
                case Done(report):
                    self._handle_done(report)
                case Ready(text):
                    run.opened_at = monotonic()
                    self._handle_ready(process, text)
                case Failed(reason, permanent):
                    run.reason, run.permanent = reason, permanent

    def _handle_ready(self, process: WorkerProcess, text: str) -> None:
        with self._lock:
            self._ready = True
        self._set_state("running", "")
        self._inbox.post(partial(self._spec.on_ready, text))
        writers, awaited = self._writers, self._awaited

        def send(slot: int, job: Job) -> bool:
            match_wait = MATCH_WAIT if awaited.isdisjoint(job.tasks) else AWAITED_MATCH_WAIT
            return process.perform(slot, job, [writer.matched for writer in writers], match_wait)

        self._jobs.connect(send)

    def _handle_done(self, report: Any) -> None:
        job = self._jobs.finish()
        if job is not None:
            self.status.performed += 1
            self._awaited.difference_update(job.tasks)
            self._inbox.post(partial(self._spec.on_done, job, report))
        self._resume_if_settled()

    def _log(self, record: logging.LogRecord) -> None:
        logger = logging.getLogger(record.name)
        if logger.isEnabledFor(record.levelno):
            logger.handle(record)

    def _set_unavailable(self, reason: str) -> None:
        self._set_state("unavailable", reason)
        self._post_lost(self._jobs.close(), reason)
        self._resume_if_settled()

    def _report_lost(self, tasks: frozenset[str], reason: str) -> None:
        if tasks:
            self._post_lost(tasks, reason)
        self._resume_if_settled()

    def _resume_if_settled(self) -> None:
        """Lets the loop continue if no job is left, after the callbacks that were posted before."""
        if self._spec.sync:
            self._inbox.post(self._unblock_steps)

    def _unblock_steps(self) -> None:
        # Checked on the physics thread, because it may have submitted another job in the meantime.
        if self._jobs.settled:
            self._spec.block_steps(False)

    def _post_lost(self, tasks: frozenset[str], reason: str) -> None:
        self._awaited.difference_update(tasks)
        self._inbox.post(partial(self._spec.on_lost, tasks, reason))

    def _set_state(self, state: str, reason: str) -> None:
        self.status.state, self.status.reason = state, reason

    def _kill(self) -> None:
        with self._lock:
            if self._process is not None:
                self._process.kill()
