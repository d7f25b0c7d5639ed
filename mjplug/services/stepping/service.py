"""Declares `~/step`: takes steps with controls and messages, and returns what they led to, in one request."""

from contextlib import nullcontext
from typing import Any

from mjplug.contracts.topics import Topics
from mjplug.contracts.transport import BytesTransport
from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.physics.model_change import ModelChange
from mjplug.physics.scheduler import Event
from mjplug.physics.step_goals import StepGoal
from mjplug.plugin import Call, Host, Slow
from mjplug.services.stepping.actions import MAX_ACTIONS, checked_controls
from mjplug.services.stepping.arrays import Observed, check_count
from mjplug.services.stepping.ownership import Ownership
from mjplug.services.stepping.response_frame import ResponseFrames
from mjplug.services.stepping.samples import Inputs, Outputs
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.mjplug_msgs import Step

_ANSWERED = Step.Response(success=True)
"""Returned by the handler after the response has been sent; it is ignored."""

_MAX_CACHED = 64
"""Maximum number of sets of observed arrays that are kept for later requests."""


def offer(host: Host, loop: Loop, transport: BytesTransport, topics: Topics, key: str) -> Ownership:
    """Declares the service.

    Args:
        host: The host of the server.
        loop: The physics loop.
        transport: Watches the liveliness tokens of the clients.
        topics: The topics of the server.
        key: Zenoh key of the server, such as `robot1/mjplug`.

    Returns:
        Which client steps the server.
    """
    tokens = f"{key}/@step"
    ownership = Ownership(tokens)
    stepping = _Stepping(loop, topics, ownership)

    def changed(token: str, present: bool) -> None:
        name = token.rpartition("/")[2]
        loop.inbox.post(lambda: ownership.changed(name, present))

    transport.watch_tokens(f"{tokens}/*", changed)
    loop.on_second.append(ownership.expire)
    ownership.on_left.append(stepping.owner_left)
    loop.on_model_changed.append(stepping.model_changed)
    host.create_service(Step, "~/step", stepping.step, packed=True)
    return ownership


class _Plan:
    """A request that has been checked, and its execution so far.

    Attributes:
        actions: Number of actions.
        observed: The arrays that are observed after each action.
        values: The values observed so far, one row for each action.
        frame: The response in CDR, which contains `values`; None if the response is built as a message.
        inputs: The messages to handle before the first step.
        outputs: The topics whose samples are wanted.
        generation: Number of changes of the model when the request was checked.
        begun: Whether the inputs have been handled.
        goal: The steps; None before they have begun, and if there are none.
    """

    def __init__(
        self, request: Any, form: str, loop: Loop, topics: Topics, observed: Observed, frames: ResponseFrames
    ) -> None:
        nu = observed.nu
        self.observed = observed
        self.generation = loop.simulation.generation
        self._controls = checked_controls(request.ctrl, nu)
        self._next_control = self._next_value = 0
        self.actions = actions = len(self._controls) // nu if self._controls else 1
        if actions > MAX_ACTIONS:
            raise RequestError(f"ctrl has {actions} rows; at most {MAX_ACTIONS} are accepted")
        self.steps: int = request.steps
        if not self.steps and actions > 1:
            raise RequestError(f"steps is 0 with {actions} actions; it must be at least 1 with several actions")
        if loop.simulation.step + self.steps * actions > loop.last_step:
            raise RequestError(f"{actions} * {self.steps} steps would exceed the last possible step, {loop.last_step}")
        check_count(observed.width * actions, form)
        self.inputs = Inputs(topics, request.inputs) if request.inputs else None
        self.outputs = Outputs(topics, request.outputs, form) if request.outputs else None
        # Several requests may have the same frame, because one begins its steps only after the one before has ended.
        self.frame = frames.frame(observed, actions) if form == "cdr" and self.outputs is None else None
        self.values = (
            self.frame.values
            if self.frame is not None
            else memoryview(bytearray(8 * observed.width * actions)).cast("d")
        )
        self.begun = False
        self.goal: StepGoal | None = None

    def begin_action(self) -> None:
        """Writes the next row of controls to `ctrl`, if there are any."""
        if self._controls:
            begin, self._next_control = self._next_control, self._next_control + self.observed.nu
            self.observed.ctrl[:] = self._controls[begin : self._next_control]

    def end_action(self) -> None:
        """Adds a row with the present values of the observed arrays."""
        if self.observed.width:
            self.observed.copy_to(self.values, self._next_value)
            self._next_value += self.observed.width

    def next_action(self) -> None:
        """Ends an action and begins the next one."""
        self.end_action()
        self.begin_action()


class _Stepping:
    def __init__(self, loop: Loop, topics: Topics, ownership: Ownership) -> None:
        self._loop = loop
        self._topics = topics
        self._ownership = ownership
        self._observed: dict[tuple[str, ...], Observed] = {}
        self._frames = ResponseFrames()
        # The request whose steps are being taken, and the name of its client.
        self._goal: StepGoal | None = None
        self._client = ""
        # Set when the newest request that could not be answered at once has ended; None if there is none.
        self._last: Event | None = None

    def step(self, request: Any, call: Call) -> Step.Response | Slow:
        """Handles one request: at once if its steps take little time, otherwise as a slow service."""
        client = self._ownership.name_in(call.parameters)
        self._check_turn(client)
        observed = self._observe(tuple(request.observe))
        plan = _Plan(request, call.form, self._loop, self._topics, observed, self._frames)
        if plan.outputs is None and self._last is None and self._is_present(client):
            self._take(plan, client)
            if self._goal is None:
                return self._response(plan, call)
        return self._in_turn(plan, call, client)

    def owner_left(self, name: str) -> None:
        """Cancels the steps of a client that has left."""
        if self._goal is not None and self._client == name:
            self._loop.goals.remove(self._goal)
            self._goal.end("the client that requested the steps has left")

    def _is_present(self, client: str) -> bool:
        return not client or self._ownership.is_present(client)

    def model_changed(self, change: ModelChange) -> None:
        """Forgets the arrays of the previous model, and cancels steps that read or write them."""
        self._observed.clear()
        if self._goal is not None:
            self._loop.goals.remove(self._goal)
            self._goal.end("the model has changed")

    def _check_turn(self, client: str) -> None:
        """Checks that the simulation is paused, and that no other client steps it.

        Raises:
            RequestError: It is not so.
        """
        loop = self._loop
        if not loop.paused:
            raise RequestError("the simulation is running; pause it first (~/set_pause, or mjplug sim pause)")
        self._ownership.check(client)
        if loop.goals and (self._goal is None or not client or client != self._client):
            raise RequestError("another client steps this server; wait until its steps have been taken")

    def _observe(self, names: tuple[str, ...]) -> Observed:
        observed = self._observed.get(names)
        if observed is None:
            observed = Observed(self._loop.simulation, names)
            if len(self._observed) >= _MAX_CACHED:
                self._observed.clear()
            self._observed[names] = observed
        return observed

    def _take(self, plan: _Plan, client: str) -> None:
        """Handles the inputs and takes the steps, or begins to: `_goal` is then not None."""
        if plan.generation != self._loop.simulation.generation:
            raise RequestError("the model has changed while the request waited; send it again")
        self._ownership.claim(client)
        plan.begun = True
        if plan.inputs is not None:
            plan.inputs.handle()
        plan.begin_action()
        if plan.steps:
            loop = self._loop
            goal = plan.goal = loop.goals.add(loop.simulation.step, plan.steps, plan.actions, plan.next_action)
            self._goal, self._client = goal, client
            loop.take_goals()
            if goal.ended.is_set:
                self._goal = None

    def _in_turn(self, plan: _Plan, call: Call, client: str) -> Slow:
        """Waits until it is the request's turn, takes its steps and fetches its samples; returns the response."""
        previous, ended = self._last, Event()
        self._last = ended
        try:
            with plan.outputs or nullcontext():
                if not plan.begun:
                    if not self._is_present(client):
                        yield self._ownership.appears(client)
                    if previous is not None:
                        # An earlier request of the same client.
                        yield previous
                    self._check_turn(client)
                    self._take(plan, client)
                if plan.goal is not None:
                    try:
                        yield plan.goal.ended
                    finally:
                        self._loop.goals.remove(plan.goal)
                        self._goal = None
                if plan.outputs is not None:
                    yield from plan.outputs.fetch()
                return self._response(plan, call)
        finally:
            if self._last is ended:
                self._last = None
            # Posted, because thousands of requests may wait, each for the one before it.
            self._loop.inbox.post(ended.set)

    def _response(self, plan: _Plan, call: Call) -> Step.Response:
        """Returns the response, or sends it."""
        simulation, goal, frame = self._loop.simulation, plan.goal, plan.frame
        if goal is not None and goal.failure:
            taken = max(0, simulation.step - goal.start)
            raise RequestError(f"{goal.failure} ({taken} of {goal.last - goal.start} steps were taken)")
        plan.end_action()
        seconds, nanoseconds = divmod(simulation.time_ns, 1_000_000_000)
        if frame is not None:
            frame.set_times(simulation.step, seconds, nanoseconds, simulation.epoch)
            call.respond_frame(frame.frame)
            return _ANSWERED
        # Not validated: that would take long for many numbers, and all values are known to be valid.
        return Step.Response.unchecked(
            success=True,
            message="",
            step=simulation.step,
            stamp=Time.unchecked(sec=seconds, nanosec=nanoseconds),
            epoch=simulation.epoch,
            observations=tuple(plan.values) if call.form == "json" else plan.values,
            widths=plan.observed.widths,
            outputs=() if plan.outputs is None else plan.outputs.samples(),
        )
