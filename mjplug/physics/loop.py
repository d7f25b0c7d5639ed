"""The physics loop: the one place where steps are taken and everything that touches the state is called."""

from collections.abc import Callable, Generator
from time import perf_counter
from typing import TypeVar

from mjplug.errors import MjplugError, RequestError, is_fault
from mjplug.limits import LONGEST_TIME
from mjplug.physics.divergence import Divergence
from mjplug.physics.inbox import Inbox
from mjplug.physics.pacing import Pacer, Speed
from mjplug.physics.recovery import OnDivergence, Recovery
from mjplug.physics.reset import Reset
from mjplug.physics.scheduler import Request, Scheduler, Slow
from mjplug.physics.simulation import Simulation
from mjplug.physics.step_goals import StepGoals
from mjplug.physics.steppers import Steppers
from mjplug.physics.timing import Timing
from mjplug_schemas.message import Message

BATCH_SECONDS = 0.002
"""Wall time after which a batch of steps looks at the inbox again [s]; a request at speed `max` waits no longer."""

SECOND = 1.0
"""How often `on_second` and `on_idle` are called [s of wall time]."""

_LARGEST_BATCH = 10_000

R = TypeVar("R", bound=Request)


class Loop:
    """Owns the simulation and runs everything that touches it, in one thread.

    At each boundary between steps, in this order: posted calls, due timers and waiting requests, updates of the active
    steppers, velocity overrides, the step.

    Attributes:
        simulation: The model and its state.
        scheduler: Timers and waiting requests.
        steppers: What must run before every step.
        inbox: Where other threads post calls.
        pacer: Wall-clock pacing.
        goals: Steps to take, at full speed, while paused.
        lockstep: What simulated time waits for. While it is not empty, no step is taken, and requests are served.
        paused: Whether simulated time stands still.
        on_reset: Called after every reset, when all steppers have been told.
        on_stepped: Called whenever steps asked for while paused have been taken.
        on_idle: Called at once when `run` finds itself paused, and then about once a second of wall time while paused.
        on_second: Called with the wall time [s] about once a second of it, paused or not, at any speed.
        recovery: What follows a divergence.
        timing: How long steps take and how late they are.
        failure: The error that ended `run`, if one did.
        last_step: `run` ends when this step has been taken; at first the last one whose time fits into a message.
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
        self.on_stepped: list[Callable[[], None]] = []
        self.on_idle: list[Callable[[], None]] = []
        self.recovery = Recovery(on_divergence)
        self.on_second: list[Callable[[float], None]] = [self.recovery.report_held, self.inbox.report]
        self.timing = Timing()
        self.goals = StepGoals()
        self.lockstep: set[object] = set()
        self.failure: MjplugError | None = None
        self._end_of_time = simulation.time.steps_covering(LONGEST_TIME * 1_000_000_000 + 1) - 1
        self.last_step = self._end_of_time
        self._stopping = False
        self._batch = 1
        self._idle_at = 0.0
        self._second_at = 0.0

    @property
    def stopping(self) -> bool:
        """Whether `run` ends, or has ended."""
        return self._stopping

    def serve(self, request: R, handler: Callable[[Message, R], Message | Slow], owner: object = None) -> None:
        """Runs a service handler for one request and sends its answer, at once or when the handler's waits are over.

        `scheduler.cancel(reason, owner)` ends the waiting requests of an owner.
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
                raise
            self.scheduler.failures.log("a service failed")
            request.refuse(f"internal error: {error!r}")

    def pause(self) -> None:
        """Stops simulated time at the current boundary."""
        self.paused = True

    def resume(self) -> None:
        """Lets simulated time run; step goals that are under way are given up."""
        self.goals.give_up("interrupted: the simulation was resumed")
        self.paused = False
        self._anchor()

    def set_speed(self, speed: Speed) -> None:
        """Changes the real-time factor from now on; lag so far is forgotten."""
        self.pacer.speed = speed
        self._anchor()

    def reset(self, reset: Reset) -> None:
        """Resets the world; every request that waits is answered with a failure, and every stepper is told."""
        reset.apply(self.simulation)
        self.goals.give_up("cancelled: the world was reset")
        self.scheduler.cancel("cancelled: the world was reset")
        self.steppers.on_reset()
        self.scheduler.rephase(self.simulation.step)
        self._anchor()
        for callback in self.on_reset:
            callback()

    def stop(self) -> None:
        """Ends `run` at the next boundary. May be called on the loop's thread or through the inbox."""
        self._stopping = True

    def fail(self, error: MjplugError) -> None:
        """Ends `run` because of an error, which stays in `failure`."""
        self.failure = self.failure or error
        self.stop()

    def step(self, steps: int = 1) -> None:
        """Takes steps at full speed, paused or not, with everything due; ends early when stopped or diverged.

        Between them it waits for what is in `lockstep`; after the last one it does not.
        """
        self._poll()
        target = self.simulation.step + steps
        while self.simulation.step < target and not self._stopping:
            if self.lockstep:
                self._wait(SECOND)
                self._run_due()
            elif not self._advance(target):
                return

    def run(self) -> None:
        """Runs until stopped, paced by the wall clock; may be called again to go on."""
        self._stopping = self.failure is not None
        self._anchor()
        while not self._stopping:
            self.turn()
        self.recovery.report_held(perf_counter(), at_the_end=True)

    def turn(self) -> None:
        """Does what is to be done now, or waits for the next step's deadline or a posted call, whichever is first."""
        polled = self._poll()
        step = self.simulation.step
        if self._stopping:
            return
        now = perf_counter()
        if now >= self._second_at:
            now = self._second(now)
        if self.lockstep and (self.goals or not self.paused):
            if not polled:
                self._wait(self._second_at - now)
        elif self.paused:
            if self.goals:
                self._advance(self.goals.next_target)
            elif not polled:
                self._idle(now)
        elif self.pacer.speed == "max":
            self._advance(step + self._batch)
        else:
            due = self.pacer.due(step, now)
            if due > step:
                self.timing.lateness.append(now - self.pacer.deadline(step + 1))
                self._advance(due)
            else:
                wake = min(step + self.pacer.steps_per_wake, max(step + 1, self.scheduler.next_due))
                self._wait(min(self.pacer.deadline(wake), self._second_at) - now)

    def _second(self, now: float) -> float:
        """Calls `on_second`; returns the wall time afterwards [s]."""
        self._second_at = now + SECOND
        for callback in self.on_second:
            callback(now)
        return perf_counter()

    def _idle(self, now: float) -> None:
        """Waits for a posted call while paused, and now and then calls `on_idle`."""
        if now >= self._idle_at:
            self._idle_at = now + SECOND
            for callback in self.on_idle:
                callback()
        self._wait(min(self._idle_at, self._second_at) - now)

    def _wait(self, seconds: float) -> None:
        """Waits for a posted call, and runs it."""
        self.inbox.wait(max(0.0, seconds))
        self.simulation.positions_changed()

    def _poll(self) -> bool:
        """Runs posted calls, and what they made due at this very boundary; returns whether there were any."""
        posted = not self.inbox.empty()
        if posted:
            self.inbox.drain(BATCH_SECONDS)
            self.simulation.positions_changed()
        self._run_due()
        return posted

    def _run_due(self) -> None:
        step = self.simulation.step
        if self.scheduler.next_due <= step:
            self.scheduler.run_due(step)
            self.simulation.positions_changed()
        if self.lockstep:
            # This boundary is not over yet; who asked for its step is answered when it is.
            return
        if self.goals and self.goals.next_target <= step:
            # Before the answer, so that a client that has it has the new time too.
            for callback in self.on_stepped:
                callback()
            self.goals.end_reached(step)
        if step >= self.last_step:
            self._end(step)

    def _end(self, step: int) -> None:
        """Ends `run` after its last step."""
        if step < self._end_of_time:
            self.stop()
        else:
            self.fail(
                MjplugError(
                    f"simulated time has reached {LONGEST_TIME} s, the end of what ROS messages can carry; "
                    "start the server again"
                )
            )

    def _advance(self, target: int) -> bool:
        """Takes at most one batch of steps towards `target`; False: a divergence forbids to go on."""
        simulation, began = self.simulation, perf_counter()
        first, target = simulation.step, min(target, self.last_step)
        if self.steppers.active:
            divergence = self._step_actively(min(target, first + self._batch))
        else:
            steps = min(target, self.scheduler.next_due) - first
            simulation.checkpoint()
            divergence = simulation.advance(min(steps, self._batch))
        taken = simulation.step - first
        if taken:
            elapsed = perf_counter() - began
            per_step = elapsed / taken
            self.timing.busy += elapsed
            self.timing.step_times.append(per_step)
            self._batch = max(1, min(_LARGEST_BATCH, int(BATCH_SECONDS / per_step), 2 * self._batch))
        if divergence is not None and not self._recover(divergence):
            return False
        self._run_due()
        return True

    def _step_actively(self, target: int) -> Divergence | None:
        """Takes steps with updates before each, until `target`, a due step or a posted call.

        Calls that were left over because they come in too fast do not end it: then steps get as much time as calls.
        """
        simulation, steppers, scheduler, nothing_posted = (
            self.simulation,
            self.steppers,
            self.scheduler,
            self.inbox.empty,
        )
        overfull = self.inbox.overfull
        while True:
            # Before the updates, so that a bad velocity override is undone too.
            simulation.checkpoint()
            steppers.update()
            if self._stopping:
                return None
            steppers.override()
            divergence = simulation.advance(1)
            step = simulation.step
            if divergence is not None or step >= target or step >= scheduler.next_due:
                return divergence
            if not steppers.active or self.lockstep or not (nothing_posted() or overfull):
                return None

    def _anchor(self) -> None:
        self.pacer.anchor(self.simulation.step, perf_counter())

    def _recover(self, divergence: Divergence) -> bool:
        """Follows the divergence policy; returns whether stepping may go on."""
        recovery = self.recovery
        consequence = recovery.decide(divergence, self.simulation, perf_counter())
        if consequence == "reset":
            self.reset(Reset())
            return True
        if consequence == "stop":
            self.fail(MjplugError(f"{recovery.last}; the server stops (sim.on_divergence: stop)"))
        else:
            self.goals.give_up(recovery.last)
            self.pause()
        return False
