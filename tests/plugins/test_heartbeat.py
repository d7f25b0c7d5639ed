import pytest
from pydantic import ValidationError

from mjplug.physics.reset import Reset
from mjplug_plugins.heartbeat import Heartbeat, HeartbeatParameters


def beats(world, topic="/mujoco_heartbeat"):
    return [m.data for m in world.published(topic)]


def test_a_beat_comes_every_second_of_simulated_time(arm_world):
    arm_world.add(Heartbeat, "heart_beat_plugin")
    arm_world.loop.step(1500)
    assert beats(arm_world) == [
        "MuJoCo ROS2 Control Heartbeat #0 | Simulation time: 1.000000s",
        "MuJoCo ROS2 Control Heartbeat #1 | Simulation time: 2.000000s",
        "MuJoCo ROS2 Control Heartbeat #2 | Simulation time: 3.000000s",
    ]


def test_rate_and_topic_are_parameters(arm_world):
    arm_world.add(Heartbeat, "pulse", update_rate=2.5, topic="alive")
    arm_world.loop.step(1000)
    assert [b.split(": ")[1] for b in beats(arm_world, "/pulse/alive")] == [f"{0.4 * k:.6f}s" for k in range(1, 6)]


def test_a_reset_restarts_the_phase_but_not_the_count(arm_world):
    arm_world.add(Heartbeat, "pulse")
    arm_world.loop.step(700)
    arm_world.loop.reset(Reset())
    arm_world.loop.step(500)
    assert [b.split("#")[1] for b in beats(arm_world)] == [
        "0 | Simulation time: 1.000000s",
        "1 | Simulation time: 2.400000s",
    ]


def test_nothing_is_built_when_nobody_listens(arm_world):
    arm_world.add(Heartbeat, "pulse")
    arm_world.transport.publishers["/mujoco_heartbeat"].matched = False
    arm_world.loop.step(1000)
    assert beats(arm_world) == []


@pytest.mark.parametrize("rate", [0, -1.0, float("nan"), float("inf"), "1.0", True])
def test_a_rate_that_is_no_positive_number_is_refused(rate):
    with pytest.raises(ValidationError):
        HeartbeatParameters(update_rate=rate)
