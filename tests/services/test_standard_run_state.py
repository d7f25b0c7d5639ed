"""Run state, steps and resets of the standard interface."""

import pytest
from standard_worlds import StandardWorld

from mjplug.physics.scheduler import Event
from mjplug.plugin import Parameters, Plugin
from mjplug_schemas.simulation_interfaces import SetSimulationState, SimulateSteps, SimulationState
from mjplug_schemas.std_srvs import Trigger

STOPPED, PLAYING, PAUSED, QUITTING = range(4)


def set_state(world, state):
    return world.code("SetSimulationState", state={"state": state})[0]


def test_a_paused_server_starts_stopped_and_a_running_one_plays():
    assert StandardWorld(paused=True).state == STOPPED
    assert StandardWorld(paused=False).state == PLAYING


@pytest.mark.parametrize("state", [STOPPED, PLAYING, PAUSED])
def test_a_state_that_is_already_set_has_its_own_code(state):
    world = StandardWorld(paused=True)
    if state != STOPPED:
        assert set_state(world, state) == 1
    assert set_state(world, state) == 101
    assert world.state == state


@pytest.mark.parametrize("before", [STOPPED, PLAYING, PAUSED])
@pytest.mark.parametrize("after", [STOPPED, PLAYING, PAUSED])
def test_every_transition_between_run_states(before, after):
    world = StandardWorld(paused=True)
    if before != STOPPED:
        set_state(world, before)
    world.data.qpos[0] = 7.0
    assert set_state(world, after) == (101 if before == after else 1)
    assert world.state == after
    assert world.loop.paused == (after != PLAYING)
    was_reset = after == STOPPED and before != STOPPED
    assert world.data.qpos[0] == (0.5 if was_reset else 7.0)


@pytest.mark.parametrize("state", [4, 5, 6, 255])
def test_states_of_worlds_and_unknown_ones_cannot_be_set(state):
    world = StandardWorld()
    code, text = world.code("SetSimulationState", state={"state": state})
    assert (code, f"state {state}" in text) == (103, True)


def test_quitting_needs_the_setting():
    world = StandardWorld()
    assert set_state(world, QUITTING) == 0
    assert not world.loop.stopping


def test_quitting_answers_before_the_loop_stops():
    world = StandardWorld(allow_quit=True)
    request = SetSimulationState.Request(state=SimulationState(state=QUITTING))
    call = world.transport.call("/set_simulation_state", request)
    world.loop.turn()
    assert call.response.result.result == 1
    world.loop.turn()
    assert world.loop.stopping


def test_any_step_and_any_set_state_ends_stopped():
    world = StandardWorld()
    world.step(1)
    assert world.state == PAUSED
    assert set_state(world, STOPPED) == 1
    assert world.state == STOPPED
    world.ask("SetEntityState", entity="cup", state={"pose": {"orientation": {"w": 1.0}}}, set_pose=True)
    assert world.state == PAUSED


def test_steps_are_answered_after_the_last_one_and_leave_the_simulation_paused():
    world = StandardWorld()
    call = world.send("StepSimulation", steps=500)
    assert not call.answered
    while not call.answered:
        world.loop.turn()
    assert call.response.result.result == 1
    assert world.simulation.step == 500
    assert world.state == PAUSED


@pytest.mark.parametrize("steps", [0, 1 << 62, (1 << 64) - 1])
def test_impossible_numbers_of_steps_are_refused(steps):
    world = StandardWorld()
    code, text = world.code("StepSimulation", steps=steps)
    assert (code, f"steps is {steps}" in text) == (4, True)
    assert world.simulation.step == 0


def test_steps_while_playing_are_refused():
    world = StandardWorld(paused=False)
    assert world.code("StepSimulation", steps=1)[0] == 4


def test_a_pause_and_a_reset_end_waiting_steps_with_a_reason():
    world = StandardWorld()
    call = world.send("StepSimulation", steps=100_000)
    world.loop.turn()
    assert set_state(world, PAUSED) == 101
    assert set_state(world, PLAYING) == 1
    world.loop.step(0)
    assert call.answered
    assert call.response.result.result == 4
    assert "of 100000 steps" in call.response.result.error_message
    set_state(world, PAUSED)
    call = world.send("StepSimulation", steps=100_000)
    world.ask("ResetSimulation")
    assert call.answered


@pytest.mark.parametrize(
    ("scope", "time", "state"),
    [(0, True, True), (1, True, False), (2, False, True), (3, True, True), (4, False, False), (255, True, True)],
)
def test_each_scope_resets_its_part_in_one_epoch(scope, time, state):
    world = StandardWorld()
    world.step(100)
    before, moved = world.simulation.epoch, world.data.qpos[2]
    assert world.code("ResetSimulation", scope=scope) == (1, "")
    assert world.time_ns == (0 if time else 200_000_000)
    assert world.data.time == pytest.approx(world.time_ns / 1e9)
    assert world.data.qpos[2] == (1.0 if state else moved)
    assert world.simulation.epoch == before + (time or state)
    assert world.simulation.step == 100
    world.step(1)
    assert world.time_ns == (2_000_000 if time else 202_000_000)


@pytest.mark.parametrize("scope", [8, 9, 128, 254])
def test_unknown_scopes_are_refused(scope):
    world = StandardWorld()
    world.step(10)
    code, text = world.code("ResetSimulation", scope=scope)
    assert (code, f"scope is {scope}" in text) == (4, True)
    assert world.time_ns == 20_000_000


@pytest.mark.parametrize("paused", [True, False])
def test_a_reset_neither_pauses_nor_resumes(paused):
    world = StandardWorld(paused=paused)
    world.step(1)
    world.ask("ResetSimulation")
    assert world.loop.paused == paused


def test_the_epoch_is_published_before_the_time_that_goes_back():
    world = StandardWorld()
    world.step(100)
    order = []
    for name in ("/clock", "/mjplug/epoch"):
        world.transport.publishers[name].tap = lambda message, name=name: order.append(name)
    world.ask("ResetSimulation", scope=1)
    assert order == ["/mjplug/epoch", "/clock"]
    assert world.published("/clock")[-1].clock.sec == 0
    assert world.published("/clock")[-1].clock.nanosec == 0


class Counting(Plugin[Parameters]):
    """Remembers a time relative to the present one, as plugins with time limits do."""

    def init(self, host, parameters):
        self.host, self.until, self.resets, self.fired = host, 0, 0, []
        host.create_timer(0.05, lambda: self.fired.append(host.step))

    def on_reset(self):
        self.resets += 1

    def save(self):
        return {"left": self.until - self.host.time_ns}

    def restore(self, saved):
        self.until = self.host.time_ns + saved["left"]


def test_plugins_continue_when_only_the_time_is_reset():
    world = StandardWorld()
    plugin = world.add(Counting)
    world.step(30)
    plugin.until = world.time_ns + 1_000_000_000
    positions = world.data.qpos.copy()
    assert world.code("ResetSimulation", scope=1)[0] == 1
    assert plugin.until == 1_000_000_000
    assert plugin.resets == 0
    assert world.data.qpos.tolist() == positions.tolist()
    world.step(50)
    # The timer keeps its phase: every 25 steps since the start.
    assert plugin.fired == [25, 50, 75]


def test_a_state_from_before_a_time_reset_has_its_own_time():
    world = StandardWorld()
    world.step(100)
    early = world.save()
    world.step(10)
    world.ask("ResetSimulation", scope=1)
    world.step(5)
    late = world.save()
    world.restore(early)
    assert (world.simulation.step, world.time_ns) == (100, 200_000_000)
    world.restore(late)
    assert (world.simulation.step, world.time_ns) == (115, 10_000_000)


def test_an_event_that_waits_is_refused_when_the_time_is_reset():
    world = StandardWorld()
    event = Event()

    def wait(request, call):
        yield event

    world.mjplug.create_service(Trigger, "/wait", wait)
    call = world.call("/wait")
    world.ask("ResetSimulation", scope=1)
    assert call.refusal == "cancelled: simulated time was reset"


SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


def simulate(world, steps):
    goal = world.send_goal("/simulate_steps", SimulateSteps.Goal(steps=steps))
    assert goal.refusal is None
    return goal


def test_steps_as_a_goal_report_each_step_and_leave_the_simulation_paused():
    world = StandardWorld()
    goal = simulate(world, 50)
    while not goal.ended:
        world.loop.turn()
    assert (goal.status, goal.result.result.result) == (SUCCEEDED, 1)
    assert [f.completed_steps for f in goal.fed_back] == list(range(1, 51))
    assert [f.remaining_steps for f in goal.fed_back] == list(range(49, -1, -1))
    assert world.simulation.step == 50
    assert world.state == PAUSED


def test_a_long_goal_reports_less_often_and_at_the_end():
    world = StandardWorld()
    goal = simulate(world, 4321)
    while not goal.ended:
        world.loop.turn()
    assert world.simulation.step == 4321
    assert len(goal.fed_back) < 1200
    assert (goal.fed_back[-1].completed_steps, goal.fed_back[-1].remaining_steps) == (4321, 0)


def test_a_cancelled_goal_pauses_where_it_is():
    world = StandardWorld()
    goal = simulate(world, 1_000_000)
    while world.simulation.step < 5:
        world.loop.turn()
    world.cancel_goal("/simulate_steps", goal)
    assert (goal.status, goal.result.result.result) == (CANCELED, 4)
    step = world.simulation.step
    assert goal.result.result.error_message == f"cancelled after {step} of 1000000 steps"
    world.loop.turn()
    assert world.simulation.step == step
    assert world.state == PAUSED


def test_goals_do_not_count_the_steps_of_others():
    world = StandardWorld()
    one, other = simulate(world, 40), simulate(world, 25)
    while not (one.ended and other.ended):
        world.loop.turn()
    assert world.simulation.step == 65
    assert [f.completed_steps for f in one.fed_back] == list(range(1, 41))
    one, other = simulate(world, 1_000_000), simulate(world, 25)
    while not other.ended:
        world.loop.turn()
    world.cancel_goal("/simulate_steps", one)
    assert one.result.result.error_message == f"cancelled after {world.simulation.step - 90} of 1000000 steps"


@pytest.mark.parametrize(("paused", "steps"), [(True, 0), (False, 5), (True, 1 << 63)])
def test_goals_that_cannot_be_reached_are_accepted_and_aborted(paused, steps):
    world = StandardWorld(paused=paused)
    goal = simulate(world, steps)
    assert (goal.status, goal.result.result.result) == (ABORTED, 4)
    assert goal.id


def test_a_reset_and_a_start_abort_goals():
    world = StandardWorld()
    for request in (("ResetSimulation", {}), ("SetSimulationState", {"state": {"state": PLAYING}})):
        goal = simulate(world, 1_000_000)
        world.send(request[0], **request[1])
        while not goal.ended:
            world.loop.turn()
        assert (goal.status, goal.result.result.result) == (ABORTED, 4)
