"""Real robots: they convert, move as their URDFs say, hold their poses, follow steps, and drive.

Those of the package example-robot-data are downloaded once into a cache folder. Those of ROS packages are read from the
folder in the environment variable MJPLUG_ROBOTS, which contains clones of their repositories. The poses of all links
are compared with those of yourdfpy, which runs in an environment of its own.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
import yaml
from cli.process import Served
from machine import CACHE

from convert.robots import at_home, converted_file
from convert.test_skid_steering import drive
from mjplug.client import connect
from mjplug.convert.kinematics import link_poses
from mjplug.convert.measure import random_poses, set_positions
from mjplug.convert.read_urdf import read_robot
from mjplug.convert.report import Report
from mjplug.convert.source import read_source
from mjplug.model.packages import Packages
from mjplug.testing import World
from mjplug_plugins.transforms import Transforms

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
    "icub_description/robots/icub.urdf": ("free", 32),
    "hyq_description/robots/hyq_no_sensors.urdf": ("free", 12),
    "b1_description/urdf/b1.urdf": ("free", 12),
}
LEGGED = ("go2", "a1", "anymal", "solo12", "talos", "g1_29dof", "romeo")

UPSTREAM = {
    "ur_description/urdf/ur.urdf.xacro": ({"ur_type": "ur5e", "name": "ur5e"}, "fixed", 6),
    "franka_description/robots/fr3/fr3.urdf.xacro": ({}, "fixed", 8),
    "turtlebot3/turtlebot3_description/urdf/turtlebot3_burger.urdf": ({}, "free", 2),
    "turtlebot3/turtlebot3_description/urdf/turtlebot3_waffle_pi.urdf": ({}, "free", 2),
    "lbr_fri_ros2_stack/lbr_description/urdf/iiwa14/iiwa14.xacro": ({}, "fixed", 7),
    "clearpath_common/a200_whole.urdf.xacro": ({}, "free", 4),
}
"""Files below MJPLUG_ROBOTS, xacro arguments, base, and number of actuators."""

YOURDFPY = """
import json, sys, yourdfpy
request = json.load(sys.stdin)
urdf = yourdfpy.URDF.load(request["file"], load_meshes=False)
poses = []
for pose in request["poses"]:
    urdf.update_cfg(pose)
    poses.append({link: urdf.get_transform(link, urdf.base_link).tolist() for link in urdf.link_map})
json.dump(poses, sys.stdout)
"""


@pytest.mark.parametrize("name", ROBOTS, ids=lambda name: Path(name).stem)
def test_a_real_robot(robots, tmp_path, name):
    check(robots / name, tmp_path, {}, *ROBOTS[name])


@pytest.mark.parametrize("name", UPSTREAM, ids=lambda name: Path(name).name)
def test_a_robot_of_a_ros_package(tmp_path, name):
    folder = os.environ.get("MJPLUG_ROBOTS")
    if not folder or not Path(folder, name).is_file():
        pytest.skip(f"{name} is not below MJPLUG_ROBOTS ({folder})")
    arguments, base, actuators = UPSTREAM[name]
    check(Path(folder, name), tmp_path, arguments, base, actuators)


def test_the_demo_of_mujoco_ros2_control_reaches_the_poses_of_its_tests(tmp_path):
    demos = Path(os.environ.get("MJPLUG_ROBOTS", "/nowhere"), "mujoco_ros2_control/mujoco_ros2_control_demos")
    file = demos / "demo_resources/robot/test_robot.urdf"
    if not file.is_file():
        pytest.skip("mujoco_ros2_control is not below MJPLUG_ROBOTS")
    inputs = json.dumps([str(demos / "demo_resources/mjcf_generation/test_inputs.xml")])
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    server = Served(str(file), "--set", f"model_options.mujoco_inputs={inputs}", cwd=tmp_path, env=environ)
    try:
        with connect(server.endpoint) as client:
            client.wait_for("/joint_states", timeout=60.0)
            states = client.subscribe("/joint_states", depth=1)
            reached(client, states, {"joint1": 0.5, "joint2": -0.5}, {"joint1": 0.5, "joint2": -0.5}, 0.05)
            fingers = {"gripper_left_finger_joint": -0.04, "gripper_right_finger_joint": 0.04}
            reached(client, states, {"gripper_left_finger_joint": -0.04}, fingers, 0.005)
            scan = client.subscribe("/scan").next(timeout=60.0)
            assert (len(scan.ranges), scan.range_max) == (25, 10.0)
    finally:
        server.kill()


def reached(client, states, command, wanted, tolerance):
    """Sends a command, and waits until the joints are where they should be."""
    client.publish("/joint_commands", {"name": list(command), "position": list(command.values())})
    for _ in range(5000):
        state = states.next(timeout=60.0)
        found = dict(zip(state.name, state.position, strict=True))
        if all(abs(found[name] - value) <= tolerance for name, value in wanted.items()):
            return
    raise AssertionError(f"the joints are at {found}, not at {wanted}")


def check(file, tmp_path, arguments, base, actuators):
    conversion, model = converted_file(file, dict(os.environ), arguments=arguments)
    assert conversion.free == (base == "free")
    if actuators is not None:
        assert model.nu == actuators
    (tmp_path / "robot.urdf").write_bytes(conversion.files["robot.urdf"])
    robot = read_robot(read_source(tmp_path / "robot.urdf", {}, Packages({}, tmp_path)).root, Report())
    check_poses(robot, model, tmp_path / "robot.urdf")
    check_masses_and_limits(robot, model)
    check_frames(conversion, robot, model)
    check_hold(conversion, model, any(file.stem.startswith(word) for word in LEGGED))
    if not conversion.free:
        check_steps(conversion, robot, model)
    plugins = yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]
    if "diff_drive" in plugins:
        speed, rate = drive(model, plugins, 0.2, 0.0)
        assert speed == pytest.approx(0.2, rel=0.1)
        assert abs(rate) < 0.02
        assert drive(model, plugins, 0.0, 0.3)[1] == pytest.approx(0.3, rel=0.25)


def independent_poses(file, poses):
    """Returns the poses of all links in the root link, by yourdfpy."""
    uv = shutil.which("uv") or next((str(path) for path in Path.cwd().glob(".uv/bin/uv")), None)
    if uv is None:
        pytest.skip("uv is not installed, so yourdfpy cannot be run")
    command = [uv, "run", "--quiet", "--no-project", "--with", "yourdfpy", "python", "-c", YOURDFPY]
    request = json.dumps({"file": str(file), "poses": poses})
    done = subprocess.run(command, input=request, capture_output=True, text=True, check=False, timeout=500)
    assert done.returncode == 0, done.stderr
    return [{link: np.array(pose) for link, pose in found.items()} for found in json.loads(done.stdout)]


def check_poses(robot, model, file):
    data = mujoco.MjData(model)
    poses = list(random_poses(robot, 20))
    given = [{name: value for name, value in pose.items() if robot.joints[name].mimic is None} for pose in poses]
    for pose, wanted in zip(poses, independent_poses(file, given), strict=True):
        set_positions(robot, model, data, pose)
        mujoco.mj_kinematics(model, data)
        root = np.eye(4)
        if robot.root != "world":
            body = data.body(robot.root)
            root[:3, :3], root[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        ours = link_poses(robot, pose, root)
        assert set(wanted) == set(robot.links)
        for link in set(wanted) - {"world"}:
            for name, there in (("yourdfpy", root @ wanted[link]), ("own", ours[link])):
                assert np.abs(data.body(link).xpos - there[:3, 3]).max() < 1e-9, (name, link)
                assert np.abs(data.body(link).xmat.reshape(3, 3) - there[:3, :3]).max() < 1e-9, (name, link)


def check_frames(conversion, robot, model):
    """Compares /tf and /tf_static with the URDF that is published on /robot_description."""
    world = World(model)
    world.add(Transforms, "transforms")
    world.loop.step(50)
    messages = [message for topic in ("/tf", "/tf_static") for message in world.published(topic)]
    frames = {part.child_frame_id for message in messages for part in message.transforms}
    described = {link.get("name") for link in ElementTree.fromstring(conversion.files["robot.urdf"]).iter("link")}
    assert described == set(robot.links)
    assert described - {"world"} <= frames


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
    for actuator in conversion.drives:
        if actuator.kind == "position":
            error = abs(data.joint(actuator.joint).qpos[0] - conversion.home[actuator.joint])
            assert actuator.joint in weak_joints(conversion) or error < (0.1 if conversion.free else 2e-3)
    if legged:
        assert abs(data.qpos[2] - begin[2]) < 0.02, "it stands"
        up = np.zeros(9)
        mujoco.mju_quat2Mat(up, data.qpos[3:7])
        assert up[8] > 0.99


def weak_joints(conversion):
    return {note.subject for note in conversion.report.of("warning") if "sags" in note.topic}


def check_steps(conversion, robot, model):
    """Checks the response of each servo to a step; contacts are off, because arms lie on the floor at zero."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for actuator in (found for found in conversion.drives if found.kind == "position"):
        joint, home = robot.joints[actuator.joint], conversion.home[actuator.joint]
        size = 0.01 if joint.type == "prismatic" else 0.2
        if joint.range is not None and home + size > joint.range[1]:
            size = -size if home - size >= joint.range[0] else joint.range[1] - home
        if abs(size) < 1e-3 or joint.name in weak_joints(conversion):
            continue
        data = at_home(model)
        data.actuator(joint.name).ctrl[0] = home + size
        path = []
        for _ in range(500):
            mujoco.mj_step(model, data)
            path.append((float(data.joint(joint.name).qpos[0]) - home) / size)
        assert max(path) < 1.15, joint.name
        assert next(i for i, value in enumerate(path) if value > 0.63) * model.opt.timestep < 0.3, joint.name
        assert path[-1] == pytest.approx(1.0, abs=0.05), joint.name
