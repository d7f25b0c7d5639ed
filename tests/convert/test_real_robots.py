"""Real robots from the package example-robot-data: they convert, move as their URDFs say, hold their poses, and drive.

The wheel is downloaded once into a cache folder; it is neither installed nor kept in the repository.
"""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
from machine import CACHE

from convert.robots import at_home, converted_file
from mjplug.convert.kinematics import link_poses
from mjplug.convert.measure import random_poses, set_positions
from mjplug.convert.read_urdf import read_robot
from mjplug.convert.report import Report
from mjplug.convert.source import read_source
from mjplug.model.packages import Packages

PACKAGE = "example-robot-data==6.0.0"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="session")
def robots():
    """The folder with the robots of the package."""
    folder = Path(CACHE) / "example-robot-data"
    found = folder / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
    if not found.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(folder), PACKAGE]
        tools = [command, ["uv", "tool", "run", "--from", "pip", *command[2:]]]
        for tool in tools:
            try:
                done = subprocess.run(tool, capture_output=True, text=True, check=False)
            except FileNotFoundError:
                continue
            if done.returncode == 0:
                break
        wheels = list(folder.glob("*.whl"))
        if not wheels:
            pytest.skip(f"{PACKAGE} could not be downloaded")
        with zipfile.ZipFile(wheels[0]) as archive:
            archive.extractall(folder)
    return found


ROBOTS = {
    "panda_description/urdf/panda.urdf": ("fixed", 8),
    "ur_description/urdf/ur5_robot.urdf": ("fixed", 6),
    "xarm_description/urdf/xarm7.urdf": ("fixed", 7),
    "so_arm_description/urdf/so100.urdf": ("fixed", 6),
    "allegro_hand_description/urdf/allegro_right_hand.urdf": ("fixed", 16),
    "kinova_description/robots/kinova.urdf": ("fixed", 6),
    "baxter_description/urdf/baxter.urdf": ("fixed", 17),
    "go2_description/urdf/go2.urdf": ("free", 12),
    "a1_description/urdf/a1.urdf": ("free", 12),
    "anymal_b_simple_description/robots/anymal.urdf": ("free", 12),
    "solo_description/robots/solo12.urdf": ("free", 12),
    "talos_data/robots/talos_full_v2.urdf": ("free", 32),
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": ("free", 29),
    "romeo_description/urdf/romeo.urdf": ("free", 33),
    "tiago_description/robots/tiago.urdf": ("free", None),
}
LEGGED = ("go2", "a1", "anymal", "solo12", "talos", "g1_29dof", "romeo")


@pytest.mark.parametrize("name", ROBOTS, ids=lambda name: Path(name).stem)
def test_a_real_robot(robots, name):
    file = robots / name
    conversion, model = converted_file(file, dict(os.environ))
    base, actuators = ROBOTS[name]
    assert conversion.free == (base == "free")
    if actuators is not None:
        assert model.nu == actuators
    robot = read_robot(read_source(file, {}, Packages({}, file.parent)).root, Report())
    check_poses(robot, model)
    check_masses_and_limits(robot, model)
    check_hold(conversion, model, any(Path(name).stem.startswith(word) for word in LEGGED))


def check_poses(robot, model):
    data = mujoco.MjData(model)
    for pose in random_poses(robot, 20):
        set_positions(robot, model, data, pose)
        mujoco.mj_kinematics(model, data)
        root = np.eye(4)
        if robot.root != "world":
            body = data.body(robot.root)
            root[:3, :3], root[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        for link, wanted in link_poses(robot, pose, root).items():
            if link != "world":
                assert np.abs(data.body(link).xpos - wanted[:3, 3]).max() < 1e-9
                assert np.abs(data.body(link).xmat.reshape(3, 3) - wanted[:3, :3]).max() < 1e-9


def check_masses_and_limits(robot, model):
    for name, link in robot.links.items():
        if link.inertial is not None and name != "world":
            assert model.body(name).mass[0] == pytest.approx(link.inertial.mass, rel=1e-12)
    for joint in robot.scalar_joints:
        limited = bool(model.joint(joint.name).limited[0])
        assert limited == (joint.range is not None)
        if limited:
            assert tuple(model.joint(joint.name).range) == joint.range


def check_hold(conversion, model, legged):
    data = at_home(model)
    begin = data.qpos.copy()
    mujoco.mj_step(model, data, 5000)
    assert not any(int(warning.number) for warning in data.warning)
    for drive in conversion.drives:
        if drive.kind == "position":
            error = abs(data.joint(drive.joint).qpos[0] - conversion.home[drive.joint])
            assert error < (0.1 if conversion.free else 2e-3) or "baxter" in conversion.name
    if legged:
        assert abs(data.qpos[2] - begin[2]) < 0.02, "it stands"
        up = np.zeros(9)
        mujoco.mju_quat2Mat(up, data.qpos[3:7])
        assert up[8] > 0.99
