"""Tests a controller in lockstep with a simulated arm: its settling time, its overshoot, and how it takes a push.

Usage: python -m pytest test_controller.py
"""

import math
from pathlib import Path

import pytest
from controller import MAX_EFFORT, PERIOD, ElbowController

import mjplug

STEPS = 2
"""Physics steps between two commands."""


@pytest.fixture(scope="module")
def server():
    """A server in this process, which takes steps only when a test requests them."""
    with mjplug.open_server(Path(__file__).with_name("config.yaml"), run=False, environ={}) as server:
        assert server.model.opt.timestep * STEPS == pytest.approx(PERIOD)
        yield server


@pytest.fixture
def robot(server):
    """The client of the server, at the beginning of an episode."""
    server.local.reset(episode=1)
    return server.local


def drive(robot, controller, seconds):
    """Lets the controller drive the robot; returns angles [rad] and torques [N m], one for each command."""
    angles, efforts = [], []
    state = robot.step(0, outputs=["/joint_states"]).message("/joint_states")
    for _ in range(round(seconds / PERIOD)):
        command = controller.command(state)
        state = robot.step(STEPS, inputs={"/effort": command}, outputs=["/joint_states"]).message("/joint_states")
        angles.append(state.position[0])
        efforts.append(command["data"][0])
    return angles, efforts


def settling_time(angles, target, band):
    """Returns the time after which all angles are within a band around the target [s]."""
    outside = [i for i, angle in enumerate(angles) if abs(angle - target) > band]
    return PERIOD * (outside[-1] + 1) if outside else 0.0


@pytest.mark.parametrize("target", [0.3, 1.2, -1.2, math.pi / 2])
def test_the_arm_settles_at_its_target_without_overshoot(robot, target):
    """It is within 0.02 rad after half a second, and at most 2 % beyond the target."""
    angles, efforts = drive(robot, ElbowController(target), 1.0)
    overshoot = max(angle * math.copysign(1.0, target) for angle in angles) - abs(target)
    assert settling_time(angles, target, band=0.02) < 0.5
    assert overshoot < 0.02 * abs(target)
    assert angles[-1] == pytest.approx(target, abs=0.002)
    assert max(map(abs, efforts)) <= MAX_EFFORT


def test_the_arm_returns_after_a_push(robot):
    """A push of 10 rad/s moves it by more than 0.5 rad, and the motor is at its limit."""
    target = 0.8
    pushed = {"joint_states": {"name": ["elbow"], "position": [target], "velocity": [10.0]}}
    robot.reset(state_overrides=pushed, episode=1)
    angles, efforts = drive(robot, ElbowController(target), 1.0)
    assert max(angles) > target + 0.5
    assert min(efforts) == -MAX_EFFORT
    assert settling_time(angles, target, band=0.02) < 0.6


def test_a_run_can_be_repeated_bit_by_bit(robot):
    """All angles and torques are equal, not only close."""
    first = drive(robot, ElbowController(1.0), 0.5)
    robot.reset(episode=1)
    assert drive(robot, ElbowController(1.0), 0.5) == first
