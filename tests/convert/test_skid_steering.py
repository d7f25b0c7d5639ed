"""A base with four wheels turns as commanded, although its wheels slip sideways."""

import mujoco
import numpy as np
import pytest
import yaml

from convert.robots import ROVER, WHEEL, at_home, converted, joint, link, robot, tensor
from mjplug.convert.wheels import skid_multiplier
from mjplug.testing import World
from mjplug_plugins.diff_drive import DiffDrive
from mjplug_schemas.geometry_msgs import Twist, Vector3

WHEELBASE, TRACK = 0.5, 0.55


def skid_steered():
    """Returns a robot of 52 kg with four wheels."""
    parts = [link("base_link", 46.0, shape='<box size="0.8 0.4 0.2"/>', inertia=tensor(0.8, 2.6, 3.1))]
    for end, x in (("front", WHEELBASE / 2), ("rear", -WHEELBASE / 2)):
        for side, y in (("left", TRACK / 2), ("right", -TRACK / 2)):
            name, turn = f"{end}_{side}", "-1.5707963267948966 0 0"
            parts += [
                link(name, 1.5, shape=WHEEL, inertia=tensor(0.004, 0.004, 0.0075)),
                joint(f"{name}_joint", "base_link", name, "continuous", xyz=f"{x} {y} -0.05", rpy=turn, axis="0 0 1"),
            ]
    return robot(*parts, name="skid")


def drive(model, plugins, forward, rate, after_step=lambda data: None):
    """Returns the mean speed [m/s] and turning rate [rad/s] during the last second of three."""
    world = World(model)
    world.data.qpos[:] = model.key("home").qpos
    world.add(DiffDrive, "diff_drive", **{key: value for key, value in plugins["diff_drive"].items() if key != "type"})
    speeds = []
    for tick in range(1500):
        if tick % 100 == 0:
            world.publish("/cmd_vel", Twist(linear=Vector3(x=forward), angular=Vector3(z=rate)))
        world.loop.step(1)
        if tick >= 1000:
            axes = np.zeros(9)
            mujoco.mju_quat2Mat(axes, world.data.qpos[3:7])
            speeds.append((world.data.qvel[:3] @ axes.reshape(3, 3)[:, 0], world.data.qvel[5]))
            after_step(world.data)
    return np.mean(speeds, axis=0)


@pytest.mark.parametrize(("forward", "rate"), [(0.0, 0.2), (0.0, 0.5), (0.0, -1.0), (0.5, 0.5), (0.5, 0.0)])
def test_a_base_with_four_wheels_follows_cmd_vel_with_its_wheels_on_the_floor(tmp_path, forward, rate):
    conversion, model = converted(tmp_path, skid_steered())
    plugins = yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]
    assert plugins["diff_drive"]["wheel_separation_multiplier"] == pytest.approx(1 + (WHEELBASE / TRACK) ** 2, abs=1e-3)
    wheels = {model.geom(f"{end}_{side}_collision").id for end in ("front", "rear") for side in ("left", "right")}
    down = []

    def look(data):
        down.append(wheels <= {int(geom) for contact in data.contact for geom in contact.geom})

    ahead, yaw = drive(model, plugins, forward, rate, look)
    assert yaw == pytest.approx(rate, rel=0.15, abs=0.01)
    assert ahead == pytest.approx(forward, rel=0.05, abs=0.02)
    assert np.mean(down) > 0.75, "the wheels do not hop"


def test_wheels_on_one_axis_do_not_slip_and_keep_their_contact(tmp_path):
    conversion, model = converted(tmp_path, ROVER)
    assert "multiplier" not in conversion.files["mjplug.yaml"].decode()
    geom = model.geom("left_wheel_collision")
    assert (geom.priority[0], geom.solref[0]) == (0, 0.02)


def test_a_base_that_stands_on_a_slope_creeps_slowly(tmp_path):
    _, model = converted(tmp_path, skid_steered())
    slope = np.radians(10.0)
    model.opt.gravity[:] = -9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)
    data = at_home(model)
    mujoco.mj_step(model, data, 500)
    begin = data.qpos[0]
    mujoco.mj_step(model, data, 500)
    assert 0.0 < begin - data.qpos[0] < 0.04
    assert model.key_qpos[0, 2] - data.qpos[2] < 0.005, "the wheels sink in by less than 5 mm"


@pytest.mark.parametrize(("wheelbase", "track"), [(0.512, 0.555), (0.262, 0.37559), (1.0, 0.5)])
def test_the_multiplier_balances_the_friction_of_all_wheels(wheelbase, track):
    along = [wheelbase / 2, wheelbase / 2, -wheelbase / 2, -wheelbase / 2]
    sides = [track / 2, -track / 2, track / 2, -track / 2]
    rate = 1.0 / skid_multiplier(along, sides)
    torque, largest = 0.0, 0.0
    for x, y in zip(along, sides, strict=True):
        # The surface of a wheel moves at the speed that turns the base at 1 rad/s without slip.
        slip = np.array([-y + rate * y, -rate * x])
        force = slip / np.linalg.norm(slip)
        torque += x * force[1] - y * force[0]
        largest += abs(x) + abs(y)
    assert abs(torque) < 2e-3 * largest
    assert skid_multiplier([0.1, 0.1], [0.2, -0.2]) == 1.0
    assert skid_multiplier([0.101, 0.1, 0.1, 0.1], sides) == 1.0
