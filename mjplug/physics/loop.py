"""The physics loop: takes the steps, and calls everything that reads or changes the state.

Terms:
    Step number: The number of steps taken since the start. A reset does not change it.
    Boundary: The moment between two steps. Everything but the steps themselves runs at a boundary.
    Batch: One or more steps, between which no posted call, timer or request runs.
    Posted call: A function that another thread has put into the inbox, such as the handling of a request.
    Stepper: An object, such as a plugin, whose `update` is called before every step while it is active.
"""

import math
from collections.abc import Callable, Generator
from time import perf_counter
from typing import TypeVar

from mjplug.errors import MjplugError, RequestError, is_fault
from mjplug.limits import MAX_SIMULATED_TIME
from mjplug.physics.divergence import Divergence
from mjplug.physics.inbox import Inbox
from mjplug.physics.model_change import ModelChange, Replacement
from mjplug.physics.pacing import Pacer, Speed
from mjplug.physics.part import Part
from mjplug.physics.recovery import MIN_STEPS_BETWEEN_RESETS, OnDivergence, Recovery
from mjplug.physics.reset import Reset
from mjplug.physics.scheduler import Request, Scheduler, Slow
from mjplug.physics.simulation import Simulation
from mjplug.physics.step_goals import StepGoals
from mjplug.physics.steppers import Steppers
from mjplug.physics.timing import Timing
from mjplug.physics.wall_timers import WallTimers
from mjplug_schemas.message import Message

MAX_BATCH_TIME = 0.002
"""Maximum wall time of a batch of steps and of a drain of the inbox [s]. It bounds how long a request waits."""

WALL_TIMER_PERIOD = 1.0
"""Period of `on_second` and `on_idle` [s of wall time]."""

_MAX_BATCH_STEPS = 10_000
"""Maximum number of steps in a batch."""

R = TypeVar("R", bound=Request)


class Loop:
    """Owns the simulation and runs everything that touches it, in one thread.

    The order at each boundary: posted calls, due timers and waiting requests, updates of the active steppers, velocity
    overrides of the steppers. Then `Simulation.advance` writes the velocity holds and takes the step.

    `run` is used by a server, and calls `turn` again and again. `step` is used by tests, and takes steps at once.

    Attributes:
        simulation: The model and its state.
        scheduler: Timers, and requests that wait for a step or an event.
        steppers: The steppers, active or not.
        inbox: The queue to which other threads post calls.
        pacer: Wall-clock pacing.
        goals: Steps that clients request with the services `step_simulation` and `step` while paused; they are taken at
            full speed.
        lockstep: One key for each worker process that must finish its job before the next step. While the set is not
            empty, no step is taken, but requests are served.
        paused: Whether the simulation is paused.
        on_reset: Called after every reset and every restored state, after `on_reset` or `restore` of all parts.
        parts: The server itself and its plugin instances, whose states are saved.
        on_model_changing: Called before the model changes, to save what is carried over.
        on_model_changed: Called after the model has changed: the services in their order, then the plugins.
        on_stepped: Called after the steps of a goal were taken, before the request is answered; publishes `/clock`.
        on_idle: Called while `run` is paused and has nothing to do: at once, and then about once a second of wall time.
            It publishes `/clock`.
        on_second: Called with the wall time [s] about once a second of wall time, paused or not, at any speed.
        wall_timers: Timers in wall time, which run paused or not, at any speed.
        recovery: The divergence policy and its log lines.
        timing: Measured duration of steps, and how late they start [s of wall time].
        failure: The error that ended `run`; None if there was none.
        end_of_time: The last step whose time fits into a ROS message.
        last_step: `run` ends after this step. The default is the last step whose time fits into a ROS message.

    Args:
        simulation: The model and its state.
        speed: Real-time factor, or `max` for no pacing.
        paused: Whether the simulation starts paused.
        on_divergence: What to do if the state becomes invalid; the setting `sim.on_divergence`.
    """

    def __init__(
        self,
        simulation: Simulation,
        speed: Speed = "max",
        paused: bool = False,
        on_divergence: OnDivergence = "pause",
    ) -> None:
        self.simulation = simulation
        self.scheduler = Scheduler(lambda: simulation.step)
        self.steppers = Steppers(simulation)
        self.inbox = Inbox()
        self.pacer = Pacer(simulation.time, speed)
        self.paused = paused
        self.on_reset: list[Callable[[], None]] = []
        self.parts: list[Part] = []
        self.on_model_changing: list[Callable[[], None]] = []
        self.on_model_changed: list[Callable[[ModelChange], None]] = []
        self.on_stepped: list[Callable[[], None]] = []
        self.on_idle: list[Callable[[], None]] = []
        self.recovery = Recovery(on_divergence)
        self.on_second: list[Callable[[float], None]] = [self.recovery.report_suppressed, self.inbox.report_overruns]
        self.wall_timers = WallTimers()
        self.timing = Timing()
        self.goals = StepGoals(lambda: simulation.step)
        self.lockstep: set[object] = set()
        self.failure: MjplugError | None = None
        self.end_of_time = simulation.time.steps_covering(MAX_SIMULATED_TIME * 1_000_000_000 + 1) - 1
        self.last_step = self.end_of_time
        self._stopping = False
        self._taking_goals = False
        self._batch = 1
        self._idle_at = 0.0
        self._second_at = 0.0

    @property
    def stopping(self) -> bool:
        """Whether `run` ends, or has ended."""
        return self._stopping

    def serve(self, request: R, handler: Callable[[Message, R], Message | Slow], owner: object = None) -> None:
        """Runs a service handler for one request and sends the response, at once or after the handler's waits.

        Args:
            request: The request to answer.
            handler: Returns the response, or a generator that yields its waits and returns the response.
            owner: `scheduler.cancel(reason, owner)` ends the waiting requests of this owner.
        """
        try:
            result = handler(request.request, request)
            if isinstance(result, Generator):
                self.scheduler.start(result, request, owner)
            else:
                request.respond(result)
        except RequestError as error:
            request.refuse(str(error))
        except BaseException as error:
            if not is_fault(error):
                # Ctrl-C in a program that steps the server itself.
                raise
            self.scheduler.failures.log("a service failed")
            request.refuse(f"internal error: {error!r}")

    def pause(self) -> None:
        """Stops simulated time at the current boundary."""
        self.paused = True

    def resume(self) -> None:
        """Resumes simulated time; cancels all step goals."""
        self.goals.cancel("interrupted: the simulation was resumed")
        self.paused = False
        self._anchor_pacer()

    def set_speed(self, speed: Speed) -> None:
        """Changes the real-time factor from now on, and discards the current lag."""
        self.pacer.speed = speed
        self._anchor_pacer()

    def reset(self, reset: Reset) -> None:
        """Resets the world, refuses every waiting request, and calls `on_reset` of every stepper.

        The step number and simulated time continue, except with `Reset.episode`. Timers start a new period.
        """
        reset.apply(self.simulation)
        if reset.episode is not None:
            self.recovery.restore(self.simulation.step, MIN_STEPS_BETWEEN_RESETS)
        self.goals.cancel("cancelled: the world was reset")
        self.scheduler.cancel("cancelled: the world was reset")
        for part in self.parts:
            part.reset(self.simulation.lineage)
        self.steppers.on_reset()
        self.scheduler.rephase(self.simulation.step)
        self._anchor_pacer()
        for callback in self.on_reset:
            callback()

    def restore(self, put_back: Callable[[], None], reason: str = "a state was restored") -> None:
        """Refuses every waiting request, except one that calls this, and puts a saved state back.

        Args:
            put_back: Sets the state of the simulation, of the parts and of the timers. It must not fail.
            reason: The reason for the refused requests.
        """
        self.goals.cancel(f"cancelled: {reason}")
        self.scheduler.cancel(f"cancelled: {reason}")
        self.simulation.epoch += 1
        put_back()
        self._anchor_pacer()
        for callback in self.on_reset:
            callback()

    def take_goals(self) -> None:
        """Takes steps for the goals at once instead of in the next `turn`, for about `MAX_BATCH_TIME`.

        A handler that has added a goal may call this: if the steps are few, its goal has then ended already. `turn`
        takes the remaining steps.
        """
        if self._taking_goals or self._stopping or self.lockstep or not self.paused:
            return
        # Calls that were posted before this one may have changed the state.
        self.simulation.mark_poses_outdated()
        try:
            self._run_due()
            self._take_goal_steps()
        except MjplugError as error:
            # This is not the fault of the request, so it ends `run`.
            self.fail(error)

    def change_model(self, replacement: Replacement) -> None:
        """Uses a changed model from now on. Simulated time, timers, requests and steps of clients continue."""
        for prepare in self.on_model_changing:
            prepare()
        self.simulation.replace(replacement)
        self.steppers.model_changed()
        for follow in self.on_model_changed:
            follow(replacement.change)

    def stop(self) -> None:
        """Ends `run` at the next boundary. May be called on the loop's thread or through the inbox."""
        self._stopping = True

    def fail(self, error: MjplugError) -> None:
        """Ends `run` because of an error; `failure` keeps the first one."""
        self.failure = self.failure or error
        self.stop()

    def step(self, steps: int = 1) -> None:
        """Takes steps at full speed, paused or not, and runs everything that is due; with 0, only the latter.

        All calls that are posted before are made before the first step, however long they take. Returns early after
        `stop` or a divergence. Between steps it waits until `lockstep` is empty, but not after the
        last step.
        """
        self._poll(math.inf)
        target = self.simulation.step + steps
        while self.simulation.step < target and not self._stopping:
            if self.lockstep:
                self._wait(WALL_TIMER_PERIOD)
                self._run_due()
            elif not self._take_batch(target):
                return

    def run(self) -> None:
        """Runs until stopped, paced by the wall clock. May be called again to continue."""
        self._stopping = self.failure is not None
        self._anchor_pacer()
        while not self._stopping:
            self.turn()
        self.recovery.report_suppressed(perf_counter(), final=True)

    def turn(self) -> None:
        """One iteration of `run`: runs what is due, then takes steps, or waits if none is due yet.

        It waits until the deadline of the next step, or until a call is posted.
        """
        polled = self._poll(MAX_BATCH_TIME)
        step = self.simulation.step
        if self._stopping:
            return
        now = perf_counter()
        if now >= self._second_at:
            now = self._call_on_second(now)
        if now >= self.wall_timers.next_due:
            self.wall_timers.run_due(now)
            self.simulation.mark_poses_outdated()
            now = perf_counter()
        if self.lockstep and (self.goals or not self.paused):
            if not polled:
                self._wait(self._wall_due - now)
        elif self.paused:
            if self.goals:
                self._take_goal_steps()
            elif not polled:
                self._idle(now)
        elif self.pacer.speed == "max":
            self._take_batch(step + self._batch)
        else:
            due = self.pacer.due(step, now)
            if due > step:
                self.timing.lateness.append(now - self.pacer.deadline(step + 1))
                self._take_batch(due)
            else:
                # Short steps are taken in groups; a step at which a timer or a request is due is not delayed.
                wake = min(step + self.pacer.steps_per_wake, max(step + 1, self.scheduler.next_due))
                self._wait(min(self.pacer.deadline(wake), self._wall_due) - now)

    @property
    def _wall_due(self) -> float:
        """When something is due in wall time [s]."""
        return min(self._second_at, self.wall_timers.next_due)

    def _call_on_second(self, now: float) -> float:
        """Calls `on_second`; returns the wall time afterwards [s]."""
        self._second_at = now + WALL_TIMER_PERIOD
        for callback in self.on_second:
            callback(now)
        return perf_counter()

    def _idle(self, now: float) -> None:
        """Waits for a posted call while paused; before that, calls `on_idle` if it is time for it."""
        if now >= self._idle_at:
            self._idle_at = now + WALL_TIMER_PERIOD
            for callback in self.on_idle:
                callback()
        self._wait(min(self._idle_at, self._wall_due) - now)

    def _wait(self, seconds: float) -> None:
        """Waits for a posted call for at most this wall time [s], and runs it."""
        self.inbox.wait(max(0.0, seconds))
        self.simulation.mark_poses_outdated()

    def _poll(self, limit: float) -> bool:
        """Runs posted calls, then everything due at this boundary; returns whether there were posted calls.

        Args:
            limit: Wall time after which no further call is made [s].
        """
        posted = not self.inbox.empty()
        if posted:
            self.inbox.drain(limit)
            self.simulation.mark_poses_outdated()
        self._run_due()
        return posted

    def _run_due(self) -> None:
        """Runs due timers and waiting requests, then ends reached goals, and `run` if this was its last step."""
        step = self.simulation.step
        if self.scheduler.next_due <= step:
            self.scheduler.run_due(step)
            self.simulation.mark_poses_outdated()
        if self.lockstep:
            # A worker process still works on the state of this boundary; goals that end here are answered after it.
            return
        goal = self.goals.first
        if goal is not None and goal.target <= step and not goal.begin_next_part():
            # Before the response, so that a client that gets it already has the new time.
            for callback in self.on_stepped:
                callback()
            self.goals.end_reached(step)
        if step >= self.last_step:
            self._end_at_last_step(step)

    def _end_at_last_step(self, step: int) -> None:
        """Ends `run` after its last step."""
        if step < self.end_of_time:
            self.stop()
        else:
            self.fail(
                MjplugError(
                    f"simulated time has reached {MAX_SIMULATED_TIME} s, the maximum of a ROS time stamp; "
                    "restart the server"
                )
            )

    def _take_goal_steps(self) -> None:
        """Takes a batch of steps for the first goal, and more batches if it has several parts, which may be short.

        Ends after about `MAX_BATCH_TIME`, or when a call is posted.
        """
        simulation, goals, nothing_posted = self.simulation, self.goals, self.inbox.empty
        goal, first, busy, began = goals.first, simulation.step, 0.0, perf_counter()
        if goal is None:
            return
        until = began + MAX_BATCH_TIME
        self._taking_goals = True
        try:
            while True:
                divergence = self._advance(goal.target)
                busy += perf_counter() - began
                if not self._end_batch(divergence) or goals.first is not goal or not goal.in_parts:
                    break
                began = perf_counter()
                if began >= until or self.lockstep or self._stopping or not nothing_posted():
                    break
        finally:
            self._taking_goals = False
        self._measure(simulation.step - first, busy)

    def _take_batch(self, target: int) -> bool:
        """Takes at most one batch of steps towards a step number, then runs what is due.

        Args:
            target: The step number after which no step is taken.

        Returns:
            False if a divergence paused the simulation or ended `run`, otherwise True.
        """
        first, began = self.simulation.step, perf_counter()
        divergence = self._advance(target)
        self._measure(self.simulation.step - first, perf_counter() - began)
        return self._end_batch(divergence)

    def _advance(self, target: int) -> Divergence | None:
        """Takes at most one batch of steps towards a step number."""
        simulation = self.simulation
        target = min(target, self.last_step, simulation.step + self._batch)
        if self.steppers.active:
            return self._step_with_updates(target)
        simulation.checkpoint()
        return simulation.advance(min(target, self.scheduler.next_due) - simulation.step)

    def _measure(self, steps: int, seconds: float) -> None:
        """Makes the next batch longer or shorter, so that it takes about `MAX_BATCH_TIME`.

        Args:
            steps: Number of steps taken.
            seconds: Wall time that they took [s].
        """
        if steps > 0:
            per_step = seconds / steps
            self.timing.busy += seconds
            self.timing.step_times.append(per_step)
            self._batch = max(1, min(_MAX_BATCH_STEPS, int(MAX_BATCH_TIME / per_step), 2 * self._batch))

    def _end_batch(self, divergence: Divergence | None) -> bool:
        """Runs what is due after a batch; returns False if a divergence paused the simulation or ended `run`."""
        if divergence is not None and not self._recover(divergence):
            return False
        self._run_due()
        return True

    def _step_with_updates(self, target: int) -> Divergence | None:
        """Updates the steppers before each step. Ends at `target`, at a step with something due, or at a posted call.

        If the last drain of the inbox left calls in it, posted calls do not end it, so that steps get as much time as
        calls.
        """
        simulation, steppers, scheduler, nothing_posted = (
            self.simulation,
            self.steppers,
            self.scheduler,
            self.inbox.empty,
        )
        overfull = self.inbox.overfull
        while True:
            # Before the updates, so that an invalid velocity override is undone too.
            simulation.checkpoint()
            steppers.update()
            if self._stopping:
                # An update failed.
                return None
            steppers.override()
            divergence = simulation.advance(1)
            step = simulation.step
            if divergence is not None or step >= target or step >= scheduler.next_due:
                return divergence
            if not steppers.active or self.lockstep or not (nothing_posted() or overfull):
                return None

    def _anchor_pacer(self) -> None:
        """Makes the deadlines of the next steps count from now, so that time that has passed is not caught up."""
        self.pacer.anchor(self.simulation.step, perf_counter())

    def _recover(self, divergence: Divergence) -> bool:
        """Applies the divergence policy; returns whether stepping continues."""
        recovery = self.recovery
        consequence = recovery.decide(divergence, self.simulation, perf_counter())
        if consequence == "reset":
            self.reset(Reset())
            return True
        if consequence == "stop":
            self.fail(MjplugError(f"{recovery.last}; the server stops (sim.on_divergence: stop)"))
        else:
            self.goals.cancel(recovery.last)
            self.pause()
        return False
