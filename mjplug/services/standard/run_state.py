"""The run state, steps and resets of the standard interface."""

from collections.abc import Callable, Generator

from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.physics.reset import Reset
from mjplug.physics.scheduler import Wait
from mjplug.plugin import Call, Slow
from mjplug.services.standard.entities import Entities
from mjplug.services.standard.replies import UNSUPPORTED, ResultError, done
from mjplug.services.stepping.ownership import Ownership
from mjplug_schemas.simulation_interfaces import (
    GetSimulationState,
    ResetSimulation,
    SetSimulationState,
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
        if not loop.paused:
            raise RequestError("the simulation is running; set its state to PAUSED (2) first")
        if request.steps == 0:
            raise RequestError("steps is 0; it must be at least 1")
        if request.steps > loop.last_step - simulation.step:
            raise RequestError(
                f"steps is {request.steps}; at most {loop.last_step - simulation.step} more steps are possible"
            )
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
