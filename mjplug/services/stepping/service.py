"""Declares `~/step`: takes steps with controls and messages, and returns what they led to, in one request."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mjplug.contracts.topics import Topics
from mjplug.contracts.transport import BytesTransport
from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.physics.memory import float_view
from mjplug.physics.step_goals import StepGoal
from mjplug.plugin import Call, Host, Slow
from mjplug.services.stepping.actions import MAX_ACTIONS, control_rows
from mjplug.services.stepping.arrays import Observed, check_count
from mjplug.services.stepping.ownership import Ownership
from mjplug.services.stepping.samples import Inputs, Outputs
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.mjplug_msgs import Step

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
    host.create_service(Step, "~/step", stepping.step, packed=True)
    return ownership


class _Plan:
    """A request that has been checked."""

    def __init__(self, request: Any, form: str, loop: Loop, topics: Topics, observed: Observed) -> None:
        simulation = loop.simulation
        self.steps: int = request.steps
        self.rows = control_rows(request.ctrl, simulation.model.nu)
        self.actions = len(self.rows) or 1
        if self.actions > MAX_ACTIONS:
            raise RequestError(f"ctrl has {self.actions} rows; at most {MAX_ACTIONS} are accepted")
        if not self.steps and self.actions > 1:
            raise RequestError(f"steps is 0 with {self.actions} actions; it must be at least 1 with several actions")
        last = simulation.step + self.steps * self.actions
        if last > loop.last_step:
            raise RequestError(
                f"{self.actions} * {self.steps} steps would exceed the last possible step, {loop.last_step}"
            )
        self.observed = observed
        check_count(observed.width * self.actions, form)
        self.inputs = Inputs(topics, request.inputs)
        self.outputs = Outputs(topics, request.outputs, form)


class _Stepping:
    def __init__(self, loop: Loop, topics: Topics, ownership: Ownership) -> None:
        self._loop = loop
        self._topics = topics
        self._ownership = ownership
        self._observed: dict[tuple[str, ...], Observed] = {}
        # The request whose steps are being taken, and the name of its client.
        self._goal: StepGoal | None = None
        self._client = ""

    def step(self, request: Any, call: Call) -> Slow:
        """Handles one request."""
        loop, ownership = self._loop, self._ownership
        client = ownership.name_in(call.parameters)
        self._check_turn(client)
        plan = _Plan(request, call.form, loop, self._topics, self._observe(tuple(request.observe)))
        if client and not ownership.is_present(client):
            yield ownership.appears(client)
        while loop.goals:
            # An earlier request of the same client.
            self._check_turn(client)
            assert self._goal is not None
            yield self._goal.ended
        self._check_turn(client)
        ownership.claim(client)
        with plan.outputs:
            return (yield from self._run(plan, call, client))

    def owner_left(self, name: str) -> None:
        """Cancels the steps of a client that has left."""
        if self._goal is not None and self._client == name:
            self._loop.goals.remove(self._goal)
            self._goal.end("the client that requested the steps has left")

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

    def _run(self, plan: _Plan, call: Call, client: str) -> Slow:
        """Takes the steps and returns the response."""
        loop, simulation, observed = self._loop, self._loop.simulation, plan.observed
        plan.inputs.handle()
        width = observed.width
        values = np.empty(width * plan.actions)
        record = _recorder(observed, float_view(values)) if width else _nothing
        apply = _applier(plan.rows, simulation.data.ctrl) if len(plan.rows) else _nothing
        apply()

        def between() -> None:
            record()
            apply()

        if plan.steps:
            # A wait of an event costs nothing; the loop itself calls `between`.
            goal = self._goal = loop.goals.add(simulation.step, plan.steps, plan.actions, between)
            self._client = client
            try:
                yield goal.ended
            finally:
                loop.goals.remove(goal)
                self._goal = None
            if goal.failure:
                taken = max(0, simulation.step - goal.start)
                raise RequestError(f"{goal.failure} ({taken} of {goal.last - goal.start} steps were taken)")
        record()
        yield from plan.outputs.fetch()
        return self._response(plan, values, call)

    def _response(self, plan: _Plan, values: Any, call: Call) -> Step.Response:
        simulation = self._loop.simulation
        seconds, nanoseconds = divmod(simulation.time_ns, 1_000_000_000)
        observations: Any = tuple(values.tolist()) if call.form == "json" else float_view(values)
        # Not validated: that would take long for many numbers, and all values are known to be valid.
        return Step.Response.unchecked(
            success=True,
            message="",
            step=simulation.step,
            stamp=Time.unchecked(sec=seconds, nanosec=nanoseconds),
            epoch=simulation.epoch,
            observations=observations,
            widths=plan.observed.widths,
            outputs=plan.outputs.samples(),
        )


def _recorder(observed: Observed, rows: "memoryview[float]") -> Callable[[], None]:
    """Returns a function that writes the present values into the next row."""
    begin, width = 0, observed.width

    def record() -> None:
        nonlocal begin
        observed.copy_to(rows, begin)
        begin += width

    return record


def _applier(rows: Any, ctrl: Any) -> Callable[[], None]:
    """Returns a function that writes the next row of controls to `ctrl`."""
    begin, nu = 0, ctrl.size
    source, target = rows.reshape(-1).data.cast("B").cast("d"), float_view(ctrl)

    def apply() -> None:
        nonlocal begin
        target[:] = source[begin : begin + nu]
        begin += nu

    return apply


def _nothing() -> None:
    pass
