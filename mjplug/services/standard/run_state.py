"""The run state, steps and resets of the standard interface."""

from collections.abc import Callable, Generator
from time import perf_counter

from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.physics.reset import Reset
from mjplug.physics.scheduler import Wait
from mjplug.physics.step_goals import StepGoal
from mjplug.plugin import Call, Goal, GoalCanceled, Slow
from mjplug.plugin.goal import Outcome
from mjplug.services.standard.entities import Entities
from mjplug.services.standard.replies import FAILED, UNSUPPORTED, ResultError, done
from mjplug.services.stepping.ownership import Ownership
from mjplug_schemas.simulation_interfaces import (
    GetSimulationState,
    ResetSimulation,
    Result,
    SetSimulationState,
    SimulateSteps,
    SimulationState,
    StepSimulation,
)

STOPPED, PLAYING, PAUSED, QUITTING = (
    SimulationState.STATE_STOPPED,
    SimulationState.STATE_PLAYING,
    SimulationState.STATE_PAUSED,
    SimulationState.STATE_QUITTING,
)
_NAMES = {0: "STOPPED", 1: "PLAYING", 2: "PAUSED", 3: "QUITTING", 4: "NO_WORLD", 5: "LOADING_WORLD"}

TIME, STATE, SPAWNED, ALL = (
    ResetSimulation.Request.SCOPE_TIME,
    ResetSimulation.Request.SCOPE_STATE,
    ResetSimulation.Request.SCOPE_SPAWNED,
    ResetSimulation.Request.SCOPE_ALL,
)

_EACH_STEP = 1000
"""Up to this number of steps, feedback is published after each step."""

_FEEDBACK_PERIOD = 0.01
"""Minimum wall time between two feedback messages of a goal with more steps [s]."""


def steps_failed(reason: str) -> SimulateSteps.Result:
    """Returns the result of a goal that has not taken all its steps."""
    return SimulateSteps.Result(result=Result(result=FAILED, error_message=reason))


class RunState:
    """Implements the services that control the run of the simulation. Physics thread only.

    STOPPED is a paused simulation that has not been touched since it was stopped or started.

    Args:
        loop: The physics loop.
        entities: The entities, whose descriptions a complete reset restores.
        ownership: Which client steps the server.
        restart_time: Sets simulated time to zero, without other changes.
        restore_base: Removes spawned entities; its argument says whether to bring removed ones back.
        allow_quit: Whether clients may end the server.
    """

    def __init__(
        self,
        loop: Loop,
        entities: Entities,
        ownership: Ownership,
        restart_time: Callable[[], None],
        restore_base: Callable[[bool], Generator[Wait, None, None]],
        allow_quit: bool,
    ) -> None:
        self._loop = loop
        self._entities = entities
        self._ownership = ownership
        self._restart_time = restart_time
        self._restore_base = restore_base
        self._allow_quit = allow_quit
        self._stopped_at: int | None = loop.simulation.step if loop.paused else None
        self._quitting = False

    @property
    def state(self) -> int:
        """The present state, a constant of SimulationState."""
        loop = self._loop
        if self._quitting:
            return QUITTING
        if not loop.paused:
            return PLAYING
        stopped = self._stopped_at == loop.simulation.step and not loop.goals
        return STOPPED if stopped else PAUSED

    def touched(self) -> None:
        """Ends the state STOPPED, because a client has changed the state of the simulation."""
        self._stopped_at = None

    def get(self, request: GetSimulationState.Request, call: Call) -> GetSimulationState.Response:
        """Handles GetSimulationState."""
        return GetSimulationState.Response(state=SimulationState(state=self.state), result=done())

    def set(self, request: SetSimulationState.Request, call: Call) -> Slow:
        """Handles SetSimulationState."""
        wanted, loop = request.state.state, self._loop
        if wanted not in (STOPPED, PLAYING, PAUSED, QUITTING):
            name = _NAMES.get(wanted, "not a state")
            raise ResultError(
                SetSimulationState.Response.INCORRECT_TRANSITION,
                f"state {wanted} ({name}) cannot be set; "
                "it must be 0 (STOPPED), 1 (PLAYING), 2 (PAUSED) or 3 (QUITTING)",
            )
        if wanted == self.state:
            raise ResultError(
                SetSimulationState.Response.ALREADY_IN_TARGET_STATE, f"the simulation is already {_NAMES[wanted]}"
            )
        note = ""
        if wanted == QUITTING:
            self._quit(call)
        elif wanted == PLAYING:
            self._stopped_at = None
            loop.resume()
        elif wanted == PAUSED:
            self._stopped_at = None
            loop.goals.cancel("interrupted: the simulation was paused")
            loop.pause()
        else:
            loop.goals.cancel("interrupted: the simulation was stopped")
            loop.pause()
            yield from self.reset_scopes(ALL)
            self._stopped_at = loop.simulation.step
        return SetSimulationState.Response(result=done(note))

    def _quit(self, call: Call) -> None:
        if not self._allow_quit:
            raise ResultError(UNSUPPORTED, "clients may not end this server (simulation_interfaces.allow_quit)")
        self._quitting = True
        # The client gets its response before the server stops.
        call.respond(SetSimulationState.Response(result=done("the server stops")))
        self._loop.inbox.post(self._loop.stop)

    def step(self, request: StepSimulation.Request, call: Call) -> Slow:
        """Handles StepSimulation: answers after the last step."""
        loop, simulation = self._loop, self._loop.simulation
        self._check_steps(request.steps)
        self._ownership.check(self._ownership.name_in(call.parameters))
        self._stopped_at = None
        goal = loop.goals.add(simulation.step, request.steps)
        try:
            yield goal.ended
        finally:
            loop.goals.remove(goal)
        if goal.failure:
            taken = max(0, min(simulation.step, goal.target) - goal.start)
            raise RequestError(f"{goal.failure} ({taken} of {request.steps} steps were taken)")
        return StepSimulation.Response(result=done())

    def simulate(self, request: SimulateSteps.Goal, goal: Goal) -> Generator[Wait, None, Outcome]:
        """Handles a goal of SimulateSteps: steps with feedback; cancelling it pauses at the step that was reached."""
        loop, simulation, steps = self._loop, self._loop.simulation, request.steps
        try:
            self._check_steps(steps)
            self._ownership.check("")
        except RequestError as error:
            return goal.aborted(steps_failed(str(error)))
        self._stopped_at = None
        # Steps of other clients may be taken between the parts of this goal, and do not count.
        taken, reported = 0, 0.0
        wanted: StepGoal | None = None
        try:
            while taken < steps:
                left = steps - taken
                # Few steps are reported each, and many at most every `_FEEDBACK_PERIOD` of wall time.
                part = left if not goal.observed else min(left, max(1, steps // _EACH_STEP))
                wanted = loop.goals.add(simulation.step, part)
                try:
                    yield wanted.ended
                finally:
                    loop.goals.remove(wanted)
                if wanted.failure:
                    raise RequestError(wanted.failure)
                taken, now, wanted = taken + part, perf_counter(), None
                if steps <= _EACH_STEP or taken == steps or now - reported >= _FEEDBACK_PERIOD:
                    reported = now
                    if goal.observed:
                        left = steps - taken
                        goal.feedback(SimulateSteps.Feedback(completed_steps=taken, remaining_steps=left))
        except GoalCanceled:
            taken += _steps_of(wanted, simulation.step)
            return goal.canceled(steps_failed(f"cancelled after {taken} of {steps} steps"))
        except RequestError as error:
            taken += _steps_of(wanted, simulation.step)
            return goal.aborted(steps_failed(f"{error} ({taken} of {steps} steps were taken)"))
        return goal.succeeded(SimulateSteps.Result(result=done()))

    def _check_steps(self, steps: int) -> None:
        """Checks whether steps can be taken now.

        Raises:
            RequestError: They cannot.
        """
        loop = self._loop
        if not loop.paused:
            raise RequestError("the simulation is running; set its state to PAUSED (2) first")
        if steps == 0:
            raise RequestError("steps is 0; it must be at least 1")
        possible = loop.last_step - loop.simulation.step
        if steps > possible:
            raise RequestError(f"steps is {steps}; at most {possible} more steps are possible")

    def reset(self, request: ResetSimulation.Request, call: Call) -> Slow:
        """Handles ResetSimulation."""
        yield from self.reset_scopes(_scopes(request.scope))
        return ResetSimulation.Response(result=done())

    def reset_scopes(self, scopes: int) -> Generator[Wait, None, None]:
        """Resets what the bits of `scopes` select, with one new epoch; yields what to wait for.

        Args:
            scopes: Sum of TIME, STATE and SPAWNED, or ALL.
        """
        loop, simulation = self._loop, self._loop.simulation
        if scopes & SPAWNED:
            yield from self._restore_base(scopes == ALL)
        if scopes & STATE:
            if scopes & TIME:
                simulation.time.restart(simulation.step)
            loop.reset(Reset())
        elif scopes & TIME:
            self._restart_time()
        if scopes == ALL:
            self._entities.forget()


def _scopes(scope: int) -> int:
    if scope in (ResetSimulation.Request.SCOPE_DEFAULT, ALL):
        return ALL
    if scope & ~(TIME | STATE | SPAWNED):
        raise RequestError(f"scope is {scope}; it must be 0, 255 or a sum of 1 (time), 2 (state) and 4 (spawned)")
    return scope


def _steps_of(goal: StepGoal | None, step: int) -> int:
    """Returns how many steps of an ended goal were taken until a step number."""
    return 0 if goal is None else max(0, min(step, goal.target) - goal.start)
