import math

import mujoco
import numpy as np
import pytest
from joint_robots import MIXED, compiled
from pydantic import ValidationError

from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_plugins.joints.parameters import PidGains
from mjplug_plugins.joints.pid import PidBank
from mjplug_schemas.sensor_msgs import JointState

DT = 0.002


class Independent:
    """control_toolbox's law, one PID at a time, written down from its documentation."""

    def __init__(self, p=0.0, i=0.0, d=0.0, **others):
        self.p, self.i, self.d = p, i, d
        self.u = others.get("u_clamp_min", -math.inf), others.get("u_clamp_max", math.inf)
        self.limits = others.get("i_clamp_min", -math.inf), others.get("i_clamp_max", math.inf)
        self.strategy = others.get("antiwindup_strategy", "none")
        self.constant = others.get("tracking_time_constant", 0.0)
        if not self.constant and i:
            self.constant = math.sqrt(d / i) if d else p / i
        self.deadband = others.get("error_deadband", 0.0)
        self.integral, self.last = 0.0, None

    def output(self, error, dt):
        slope = 0.0 if self.last is None else (error - self.last) / dt
        self.last = error
        unlimited = self.p * error + self.integral + self.d * slope
        limited = max(self.u[0], min(self.u[1], unlimited))
        if not (self.deadband and abs(error) <= self.deadband):
            if self.strategy == "back_calculation":
                self.integral += dt * (self.i * error + (limited - unlimited) / self.constant)
            elif self.strategy != "conditional_integration" or limited == unlimited or error * unlimited <= 0:
                self.integral += dt * self.i * error
        self.integral = max(self.limits[0], min(self.limits[1], self.integral))
        return limited


GAINS = [
    {"p": 10.0},
    {"p": 3.0, "d": 0.5},
    {"p": 4.0, "i": 20.0, "d": 0.1},
    {"p": 4.0, "i": 200.0, "u_clamp_max": 3.0, "u_clamp_min": -2.0},
    {"p": 4.0, "i": 200.0, "i_clamp_max": 0.5, "i_clamp_min": -0.25},
    {"p": 4.0, "i": 90.0, "d": 0.1, "u_clamp_max": 2.0, "u_clamp_min": -2.0, "antiwindup_strategy": "back_calculation"},
    {"p": 4.0, "i": 90.0, "u_clamp_max": 2.0, "u_clamp_min": -2.0, "antiwindup_strategy": "back_calculation"},
    {
        "i": 90.0, "u_clamp_max": 2.0, "u_clamp_min": -2.0, "antiwindup_strategy": "back_calculation",
        "tracking_time_constant": 0.05,
    },
    {"p": 4.0, "i": 90.0, "u_clamp_max": 2.0, "u_clamp_min": -2.0, "antiwindup_strategy": "conditional_integration"},
    {"p": 4.0, "i": 50.0, "error_deadband": 0.4},
]  # fmt: skip


@pytest.mark.parametrize("several", [False, True])
def test_outputs_are_those_of_an_independent_implementation(several):
    """With states that move by themselves, and setpoints that jump; alone and all together."""
    for chosen in [GAINS] if several else [[gains] for gains in GAINS]:
        count = len(chosen)
        random = np.random.default_rng(7)
        state, ctrl = np.zeros(2 * count), np.zeros(count)
        places, actuators = list(range(1, 2 * count, 2)), list(reversed(range(count)))
        bank = PidBank(
            [PidGains(**g) for g in chosen], state, places, ctrl, actuators, [(-math.inf, math.inf)] * count, DT
        )
        others = [Independent(**g) for g in chosen]
        setpoints = [0.0] * count
        limited = 0
        for step in range(600):
            state[:] = np.sin(0.02 * step + np.arange(2 * count))
            if step % 100 == 0:
                setpoints = random.normal(size=count).tolist()
                for pid, setpoint in enumerate(setpoints):
                    bank.follow(pid, setpoint)
            bank.update()
            for pid, other in enumerate(others):
                expected = other.output(setpoints[pid] - state[places[pid]], DT)
                assert ctrl[actuators[pid]] == pytest.approx(expected, rel=1e-12, abs=1e-12)
                limited += abs(expected) in (2.0, 3.0)
        assert limited > 50 or not several


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308])
@pytest.mark.parametrize("name", ["setpoint", "integral", "last"])
def test_a_saved_state_with_numbers_that_would_overflow_does_not_fit(name, value):
    bank = PidBank([PidGains(i=1.0)], np.zeros(1), [0], np.zeros(1), [0], [(-math.inf, math.inf)], DT)
    saved = {key: array.copy() for key, array in bank.save().items()}
    assert bank.fits(saved)
    saved[name][0] = value
    assert not bank.fits(saved)


def test_only_those_that_run_reach_their_actuators_and_a_start_forgets_the_integral():
    state, ctrl = np.zeros(2), np.full(2, 9.0)
    unlimited = (-math.inf, math.inf)
    bank = PidBank([PidGains(i=1.0)] * 2, state, [0, 1], ctrl, [0, 1], [unlimited] * 2, DT)
    assert not bank.count
    bank.follow(0, 1.0)
    for _ in range(100):
        bank.update()
    assert ctrl == pytest.approx((99 * DT, 9.0))
    bank.stop(0)
    bank.follow(1, 1.0)
    bank.update()
    assert ctrl == pytest.approx((99 * DT, 0.0))
    bank.follow(0, 1.0)
    bank.update()
    assert ctrl == pytest.approx((0.0, DT))
    bank.stop_all()
    assert not bank.count


def world_of(**parameters):
    world = World(compiled(MIXED))
    world.plugin = world.add(JointCommands, "arm", **parameters)
    return world


def test_a_motor_follows_positions_exactly_as_an_independent_pid_around_mujoco_has_it():
    gains = {"p": 6.0, "i": 12.0, "d": 0.4, "u_clamp_max": 4.0, "u_clamp_min": -4.0}
    world = world_of(pid_gains={"position": {"elbow": gains}})
    model = compiled(MIXED)
    data, pid = mujoco.MjData(model), Independent(**gains)
    place, target, worst = model.joint("elbow").qposadr[0], 0.0, 0.0
    for step in range(1500):
        if step in (0, 700):
            target = 0.8 if step == 0 else -0.5
            world.transport.send("/arm/joint_commands", JointState(name=["elbow"], position=[target]))
        data.ctrl[2] = pid.output(target - data.qpos[place], DT)
        mujoco.mj_step(model, data)
        world.loop.step(1)
        worst = max(worst, np.abs(world.data.qpos - data.qpos).max())
    assert worst < 1e-9
    assert world.data.qpos[place] == pytest.approx(-0.5, abs=0.02)


def test_a_motor_follows_velocities_and_a_velocity_servo_positions_with_gains():
    world = world_of(pid_gains={"velocity": {"wrist_motor": {"p": 0.5, "i": 5.0}}, "position": {"rail": {"p": 5.0}}})
    world.transport.send("/arm/joint_commands", JointState(name=["wrist"], velocity=[2.0]))
    world.transport.send("/arm/joint_commands", JointState(name=["rail"], position=[0.3]))
    world.loop.step(1500)
    assert world.data.joint("wrist").qvel[0] == pytest.approx(2.0, abs=0.2)
    assert world.data.joint("rail").qpos[0] == pytest.approx(0.3, abs=0.02)


def test_an_effort_takes_the_actuator_over_from_a_pid_and_back():
    world = world_of(pid_gains={"position": {"elbow": {"p": 6.0}}, "velocity": {"elbow": {"p": 1.0}}})
    world.transport.send("/arm/joint_commands", JointState(name=["elbow"], position=[0.5]))
    world.loop.step(1)
    assert world.data.ctrl[2] == pytest.approx(3.0)
    world.transport.send("/arm/joint_commands", JointState(name=["elbow"], effort=[2.0]))
    world.loop.step(10)
    assert world.data.ctrl[2] == 0.5
    assert world.loop.steppers.active == ()
    world.transport.send("/arm/joint_commands", JointState(name=["elbow"], velocity=[1.0]))
    world.loop.step(1)
    assert world.data.ctrl[2] != 0.5
    assert [bank.count for bank in world.plugin._joints.banks] == [0, 1]


def test_joints_with_gains_can_hold_their_pose_from_the_start_and_after_a_reset():
    parameters = {"pid_gains": {"position": {name: {"p": 40.0, "d": 1.0} for name in ("elbow", "wrist")}}}
    world = World(compiled(MIXED))
    world.data.joint("elbow").qpos[0] = world.data.joint("wrist").qpos[0] = 0.6
    world.simulation.keep_as_initial()
    world.add(JointCommands, "arm", hold_at_start=True, **parameters)
    for _ in range(2):
        world.loop.step(500)
        assert world.data.joint("elbow").qpos[0] == pytest.approx(0.6, abs=0.05)
        world.transport.send("/arm/joint_commands", JointState(name=["elbow"], position=[-0.6]))
        world.loop.step(500)
        assert world.data.joint("elbow").qpos[0] == pytest.approx(-0.6, abs=0.05)
        world.loop.reset(Reset())


@pytest.mark.parametrize(
    "wrong",
    [
        {"p": math.nan}, {"u_clamp_min": 2.0, "u_clamp_max": 1.0}, {"i_clamp_max": math.nan}, {"k": 1.0},
        {"antiwindup_strategy": "hope"}, {"u_clamp_min": math.nan},
    ],
)  # fmt: skip
def test_wrong_gains_are_refused(wrong):
    with pytest.raises(ValidationError):
        PidGains(**wrong)
