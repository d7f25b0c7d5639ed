import math
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joint_robots import MIXED, compiled, recorded

from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_plugins.joints.plan import plan_of
from mjplug_plugins.joints.trajectory import Motion
from mjplug_schemas.builtin_interfaces import Duration, Time
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

TOPIC = "/arm/joint_trajectory"
SECOND = 10**9


def seconds(value):
    sec, nanosec = divmod(round(value * SECOND), SECOND)
    return Duration(sec=sec, nanosec=nanosec)


def point(at, positions, velocities=(), accelerations=()):
    return JointTrajectoryPoint(
        positions=positions, velocities=velocities, accelerations=accelerations, time_from_start=seconds(at)
    )


def trajectory(names, *points, stamp=0.0):
    time = seconds(stamp)
    header = Header(stamp=Time(sec=time.sec, nanosec=time.nanosec))
    return JointTrajectory(header=header, joint_names=names, points=points)


def world_of(xml=MIXED, **parameters):
    world = World(compiled(xml) if xml.startswith("\n") else load_model(xml).model)
    world.plugin = world.add(JointCommands, "arm", **parameters)
    return world


def servo(world):
    return float(world.data.ctrl[1])


def sampled(message, now, begin, speed, times):
    plan, now = plan_of(message), round(now * SECOND)
    motion = Motion(plan, plan.begin(now), now, np.array(begin), np.array(speed))
    return np.array([motion.at(round(t * SECOND)) for t in times])


def test_points_with_positions_alone_are_joined_by_straight_lines():
    message = trajectory(["a", "b"], point(1.0, [1.0, -2.0]), point(3.0, [5.0, 0.0]))
    times = np.linspace(10.0, 14.0, 81)
    got = sampled(message, 10.0, [0.0, 0.5], [9.0, 9.0], times)
    for row, (x0, x1, x2) in enumerate([(0.0, 1.0, 5.0), (0.5, -2.0, 0.0)]):
        expected = np.interp(times - 10.0, [0.0, 1.0, 3.0], [x0, x1, x2])
        assert np.abs(got[:, row] - expected).max() < 1e-12


cubics = st.tuples(*[st.floats(-3, 3)] * 4)
quintics = st.tuples(*[st.floats(-3, 3)] * 6)
lengths = st.floats(0.01, 20.0)


@given(curve=cubics, length=lengths, now=st.integers(0, 100))
def test_with_velocities_a_cubic_is_found_again_from_the_state_on(curve, length, now):
    length = round(length * SECOND) / SECOND
    polynomial = np.polynomial.Polynomial(curve)
    end = point(length, [polynomial(length)], [polynomial.deriv()(length)])
    times = now + np.linspace(0.0, length * 0.999, 7)
    got = sampled(trajectory(["a"], end), now, [polynomial(0.0)], [polynomial.deriv()(0.0)], times)
    scale = 1.0 + np.abs(polynomial(np.linspace(0, length, 20))).max()
    assert np.abs(got[:, 0] - polynomial(np.round(times * SECOND) / SECOND - now)).max() < 1e-9 * scale


@given(curve=quintics, length=lengths)
def test_with_accelerations_at_both_ends_a_quintic_is_found_again(curve, length):
    length = round(length * SECOND) / SECOND
    polynomial = np.polynomial.Polynomial(curve)
    x, v, a = polynomial, polynomial.deriv(), polynomial.deriv(2)
    first, last = (point(1.0 + t, [x(t)], [v(t)], [a(t)]) for t in (0.0, length))
    times = 1.0 + np.linspace(0.0, length * 0.999, 9)
    got = sampled(trajectory(["a"], first, last), 0.0, [0.0], [0.0], times)
    scale = 1.0 + np.abs(polynomial(np.linspace(0, length, 20))).max()
    assert np.abs(got[:, 0] - polynomial(np.round(times * SECOND) / SECOND - 1.0)).max() < 1e-9 * scale


def test_the_servo_is_told_every_step_where_to_be_and_holds_the_end():
    world = world_of()
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.2, [0.4]), point(0.5, [-0.2])))
    controls = recorded(world, 400)[:, 1]
    expected = np.interp(np.arange(400) * 0.002, [0.0, 0.2, 0.5], [0.0, 0.4, -0.2])
    assert np.abs(controls - expected).max() < 1e-12
    assert world.loop.steppers.active == ()
    assert controls[-1] == -0.2


def test_a_stamp_says_when_it_starts_and_until_the_first_point_the_joint_goes_there():
    world = world_of()
    world.loop.step(100)
    begin = float(world.data.joint("shoulder").qpos[0])
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.1, [0.4]), point(0.2, [0.5]), stamp=0.5))
    controls = recorded(world, 300)[:, 1]
    expected = np.interp(0.2 + np.arange(300) * 0.002, [0.2, 0.6, 0.7], [begin, 0.4, 0.5])
    assert np.abs(controls - expected).max() < 1e-12


def test_a_stamp_in_the_past_joins_the_trajectory_where_it_is_now():
    world = world_of()
    world.loop.step(500)
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.0, [0.0]), point(2.0, [1.0]), stamp=0.5))
    world.loop.step(1)
    assert servo(world) == pytest.approx(0.25)


def test_a_new_trajectory_takes_over_the_joints_that_it_names_and_others_continue():
    world = world_of(pid_gains={"position": {"elbow": {"p": 10.0}}})
    world.transport.send(TOPIC, trajectory(["shoulder", "elbow"], point(1.0, [1.0, 1.0])))
    world.loop.step(100)
    place = float(world.data.joint("shoulder").qpos[0])
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.2, [-0.5])))
    controls = recorded(world, 101)[:, 1]
    assert controls == pytest.approx(np.interp(np.arange(101) * 0.002, [0.0, 0.2], [place, -0.5]))
    bank = world.plugin._joints.banks[0]
    world.loop.step(99)
    assert bank.setpoint[0] == pytest.approx(0.598)
    world.loop.step(400)
    assert bank.setpoint[0] == 1.0


def test_from_the_desired_state_a_new_trajectory_continues_without_a_jump():
    world = world_of(interpolate_from_desired_state=True)
    world.transport.send(TOPIC, trajectory(["shoulder"], point(1.0, [1.0])))
    world.loop.step(100)
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.5, [1.0], [0.0])))
    controls = recorded(world, 250)[:, 1]
    # It started at the commanded 0.2 rad and 1 rad/s; the arm lags behind.
    assert controls[0] == pytest.approx(0.2)
    assert controls[1] - controls[0] == pytest.approx(0.002, rel=0.02)
    assert world.data.joint("shoulder").qpos[0] < 1.0


def test_a_value_takes_its_joint_out_of_the_trajectory():
    world = world_of(pid_gains={"position": {"elbow": {"p": 10.0}}})
    world.transport.send(TOPIC, trajectory(["shoulder", "elbow"], point(1.0, [1.0, 1.0])))
    world.loop.step(50)
    world.transport.send("/arm/joint_commands", JointState(name=["shoulder"], position=[0.1]))
    world.loop.step(500)
    assert servo(world) == 0.1
    assert world.plugin._joints.banks[0].setpoint[0] == 1.0


def test_a_trajectory_without_points_stops_its_joints_where_they_are():
    world = world_of()
    world.transport.send(TOPIC, trajectory(["shoulder"], point(1.0, [1.0])))
    world.loop.step(200)
    here = float(world.data.joint("shoulder").qpos[0])
    world.transport.send(TOPIC, trajectory(["shoulder"]))
    world.loop.step(300)
    assert servo(world) == here


def test_a_reset_cancels_it():
    world = world_of()
    world.transport.send(TOPIC, trajectory(["shoulder"], point(1.0, [1.0])))
    world.loop.step(100)
    world.loop.reset(Reset())
    world.loop.step(100)
    assert servo(world) == 0.0
    assert world.loop.steppers.active == ()


def test_what_was_refused_leaves_the_motion_under_way_as_it_is():
    world = world_of()
    world.transport.send(TOPIC, trajectory(["shoulder"], point(1.0, [1.0])))
    world.loop.step(100)
    world.transport.send(TOPIC, trajectory(["shoulder"], point(0.1, [0.0]), point(0.2, [math.nan])))
    controls = recorded(world, 100)[:, 1]
    assert np.abs(controls - (0.2 + np.arange(100) * 0.002)).max() < 1e-12


def refused(world, message):
    before = world.data.ctrl.copy()
    world.transport.send(TOPIC, message)
    world.loop.step(1)
    assert (world.data.ctrl == before).all()
    return world.diagnostics.diagnose()["arm"].message


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (trajectory([], point(1.0, [])), "joint_names is empty"),
        (trajectory(["sholder"], point(1.0, [0.0])), "unknown commandable joint 'sholder', did you mean 'shoulder'?"),
        (trajectory(["loose"], point(1.0, [0.0])), "unknown commandable joint 'loose'"),
        (trajectory(["shoulder"] * 2, point(1.0, [0.0, 1.0])), "joint_names[1]: 'shoulder' is listed twice"),
        (
            trajectory(["wrist"], point(1.0, [0.0])),
            "accepts effort commands, not position; set pid_gains.position.wrist to allow it",
        ),
        (
            trajectory(["shoulder"], point(1.0, [1.0, 2.0])),
            "the length of points[0].positions is 2, but that of joint_names is 1",
        ),
        (
            trajectory(["shoulder"], point(1.0, [1.0], [1.0, 1.0])),
            "the length of points[0].velocities is 2, but that of joint_names is 1",
        ),
        (trajectory(["shoulder"], point(1.0, [math.nan])), "points[0].positions contains nan; numbers must be finite"),
        (trajectory(["shoulder"], point(1.0, [])), "points[0] has no positions"),
        (
            trajectory(["shoulder"], point(1.0, [1.0]), point(1.0, [2.0])),
            "points[1].time_from_start is 1 s; times must not be negative and must increase",
        ),
        (trajectory(["shoulder"], point(-1.0, [1.0])), "points[0].time_from_start is -1 s"),
        (
            trajectory(["shoulder"], point(0.1, [1.0]), stamp=0.1),
            "the trajectory ends at 0.2 s, but simulated time is 1 s",
        ),
        (trajectory(["shoulder"], point(0.1, [1.0]), stamp=1.7e9), "simulated time is 1 s; set it to simulated time"),
        (
            trajectory(["shoulder"], point(1.0, [1.0], [1.7e308])),
            "points[0].velocities contains 1.7e+308; numbers must be",
        ),
        (
            trajectory(["shoulder"], point(1.0, [1.0], [0.0], [math.inf])),
            "points[0].accelerations contains inf; numbers",
        ),
        (
            trajectory(["shoulder"], point(0.1, [1e12])),
            "points[0].positions contains 1e+12; numbers must be finite and below",
        ),
    ],
)
def test_an_invalid_trajectory_moves_nothing_and_is_reported_in_the_diagnostics(message, sentence, caplog):
    world = world_of()
    world.loop.step(500)
    told = refused(world, message)
    assert told.startswith(f"{TOPIC}: ")
    assert sentence in told
    assert sentence in caplog.text


def test_the_arm_follows_a_trajectory_and_arrives():
    world = world_of("bundled:arm")
    goal = point(2.0, [1.2, -0.8], [0.0, 0.0], [0.0, 0.0])
    world.transport.send(TOPIC, trajectory(["joint1", "joint2"], goal))
    worst = 0.0
    for step in range(1, 1001):
        world.loop.step(1)
        s = step / 1000
        told = (3 - 2 * s) * s * s
        worst = max(worst, *np.abs(world.data.qpos[:2] - np.array([1.2, -0.8]) * told))
    # The state has no accelerations, so it is a cubic; the servos lag behind by damping over stiffness.
    assert worst < 0.05
    world.loop.step(500)
    assert world.data.qpos[:2] == pytest.approx((1.2, -0.8), abs=0.03)


def test_the_quadruped_sits_down_and_stands_up_by_a_trajectory():
    model = load_model("bundled:quadruped").model
    world = World(model, keyframe="home")
    world.add(JointCommands, "arm")
    legs = [f"{leg}_{part}_joint" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")]
    stand, sit = [0.0, 0.8, -1.6] * 4, [0.0, 1.2, -2.4] * 4
    zeros = [0.0] * 12
    heights = []
    message = trajectory(
        legs, point(0.5, stand, zeros), point(1.5, sit, zeros), point(2.0, sit, zeros), point(3.0, stand, zeros)
    )
    world.transport.send(TOPIC, message)
    for _ in range(4):
        world.loop.step(500)
        heights.append(float(world.data.qpos[2]))
        assert world.data.qpos[3] ** 2 > 0.98
    assert heights[1] < 0.22
    assert heights[3] == pytest.approx(0.307, abs=0.02)


def test_a_trajectory_is_checked_on_the_thread_of_the_transport(monkeypatch):
    world, threads = world_of(), []

    def checked(message):
        threads.append(threading.current_thread())
        return plan_of(message)

    monkeypatch.setattr("mjplug_plugins.joints.trajectories.plan_of", checked)
    message = trajectory(["shoulder"], point(0.1, [0.5]))
    sender = threading.Thread(target=world.transport.send, args=(TOPIC, message))
    sender.start()
    sender.join()
    world.loop.step(1)
    assert threads == [sender]
    assert world.plugin.accepted == 1
