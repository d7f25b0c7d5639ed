"""`~/step`: which client may step, and in which order."""

import pytest
from step_worlds import carts, finish, refusal, send, step, token

from mjplug.services.stepping.ownership import MAX_TOKEN_WAIT
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause, StepSimulation


@pytest.fixture
def world():
    return carts()


def test_a_second_client_cannot_step_until_the_first_has_left(world):
    token(world, "one")
    token(world, "two")
    step(world, "one", ctrl=[1.0, 0.0])
    other = "another client steps this server (owner 'one'); wait until it has disconnected"
    assert refusal(world, "two", ctrl=[9.0, 9.0]) == other
    assert refusal(world, ctrl=[9.0, 9.0]) == other
    assert world.call("/mjplug/step_simulation", StepSimulation.Request(steps=1)).refusal == other
    step(world, "one")
    token(world, "one", present=False)
    assert step(world, "two", observe=["ctrl"]).observations[0] == 1.0


def test_a_request_waits_for_the_token_of_its_client(world):
    call = send(world, "late")
    world.loop.step(0)
    assert not call.answered
    token(world, "late")
    assert finish(world, call).response.step == 1


def test_a_client_without_token_is_refused(world):
    call = send(world, "ghost", ctrl=[1.0, 1.0])
    world.loop.step(0)
    _, event = world.ownership._awaited["ghost"]
    world.ownership.expire(float("inf"))
    assert event.is_set
    assert MAX_TOKEN_WAIT < 10.0
    assert "the liveliness token mjplug/@step/ghost does not exist" in finish(world, call).refusal
    assert not world.data.ctrl.any()
    assert world.ownership.owner == ""


@pytest.mark.parametrize("name", ["a/b", "*", "x" * 65, "ä"])
def test_the_name_of_an_owner_is_checked(world, name):
    assert "it must have 1 to 64 English letters" in refusal(world, name)


def test_thousands_of_requests_that_wait_are_answered_in_their_order(world):
    token(world, "one")
    first = send(world, "one", steps=1000)
    world.loop.step(0)
    assert not first.answered
    # With and without steps, because those without end at once.
    calls = [send(world, "one", steps=i % 2, observe=["qpos"]) for i in range(3000)]
    finish(world, calls[-1], turns=10_000)
    assert [call.response.step for call in calls] == [1000 + (i + 1) // 2 for i in range(3000)]


def test_the_steps_of_an_owner_that_leaves_end(world):
    token(world, "one")
    token(world, "two")
    call = send(world, "one", steps=1_000_000_000)
    world.loop.turn()
    assert world.simulation.step > 0
    token(world, "one", present=False)
    taken = world.simulation.step
    assert finish(world, call).refusal == (
        f"the client that requested the steps has left ({taken} of 1000000000 steps were taken)"
    )
    assert step(world, "two").step == taken + 1


def test_requests_of_one_owner_are_taken_in_turn(world):
    token(world, "one")
    calls = [send(world, "one", steps=3, ctrl=[float(i), 0.0], observe=["ctrl"]) for i in range(4)]
    finish(world, calls[-1])
    assert [call.response.step for call in calls] == [3, 6, 9, 12]
    assert [call.response.observations[0] for call in calls] == [0.0, 1.0, 2.0, 3.0]


def test_unnamed_clients_cannot_step_during_the_steps_of_another(world):
    first = send(world, steps=1_000_000_000)
    world.loop.turn()
    second = send(world, ctrl=[5.0, 5.0])
    world.loop.turn()
    assert second.refusal == "another client steps this server; wait until its steps have been taken"
    world.call("/mjplug/set_pause", SetPause.Request(paused=True))
    assert "interrupted: the simulation was paused" in first.refusal
    assert not world.data.ctrl.any()
