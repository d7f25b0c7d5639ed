"""Every bundled plugin continues when an entity is added or removed, as if nothing had happened."""

import logging

import numpy as np
import pytest
from camera_scenes import gl  # noqa: F401 - a fixture
from standard_worlds import StandardWorld
from wrenches import push, request

from mjplug.plugin import Parameters, Plugin, PluginError
from mjplug_plugins.base_velocity import BaseVelocity
from mjplug_plugins.camera import Camera
from mjplug_plugins.diff_drive import DiffDrive
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher
from mjplug_plugins.heartbeat import Heartbeat
from mjplug_plugins.joints import JointCommands, JointStatePublisher
from mjplug_plugins.lidar import Lidar
from mjplug_plugins.odometry import OdometryPublisher
from mjplug_plugins.rangefinder_lidar import RangefinderLidar
from mjplug_plugins.robot_description import RobotDescription
from mjplug_plugins.sensors import Sensors
from mjplug_plugins.transforms import Transforms
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

SCENE = """
<mujoco model="yard">
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <geom name="wall" type="box" size=".1 9 9" pos="4 0 0"/>
    <site name="mast" pos="0 0 2"/>
    <camera name="eye" pos="0 0 6" resolution="32 24"/>
    <body name="base" pos="0 0 1">
      <freejoint name="base"/>
      <geom type="box" size=".2 .2 .1" mass="3"/>
      <site name="imu"/><site name="ray-0" euler="0 90 0"/><site name="ray-1" euler="0 90 20"/>
    </body>
    <body name="spare" pos="9 0 0"><freejoint name="spare"/><geom size=".1"/></body>
    <body name="arm" pos="0 3 0">
      <joint name="shoulder" axis="0 0 1" damping="1"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0" mass="1"/>
      <body name="hand" pos=".5 0 0"><joint name="wrist" axis="0 1 0" damping=".5"/><geom size=".05" mass=".3"/></body>
    </body>
    <body name="car" pos="0 -3 0">
      <freejoint name="car"/>
      <geom type="box" size=".3 .2 .05" mass="2"/>
      <body name="left" pos="0 .2 0"><joint name="left" axis="0 1 0"/><geom size=".1" mass=".2"/></body>
      <body name="right" pos="0 -.2 0"><joint name="right" axis="0 1 0"/><geom size=".1" mass=".2"/></body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="20"/><motor name="wrist" joint="wrist"/>
    <velocity name="left" joint="left" kv=".1"/><velocity name="right" joint="right" kv=".1"/>
  </actuator>
  <sensor>
    <gyro name="body_gyro" site="imu" noise=".01"/><accelerometer name="body_accel" site="imu" noise=".02"/>
    <jointpos name="wrist_angle" joint="wrist"/>
    <rangefinder name="front-0" site="ray-0"/><rangefinder name="front-1" site="ray-1"/>
  </sensor>
</mujoco>
"""

NEW = """
<mujoco>
  <worldbody>
    <geom name="plate" type="box" size=".01 .01 .01" pos="0 0 9"/>
    <site name="spot"/>
    <body name="body"><freejoint name="free"/><geom size=".01" mass=".001"/><site name="own"/>
      <body name="arm"><joint name="hinge"/><geom size=".01" mass=".001"/></body></body>
  </worldbody>
  <actuator><motor name="engine" joint="hinge"/></actuator>
  <sensor><gyro name="own_gyro" site="own"/><accelerometer name="own_accel" site="own"/></sensor>
</mujoco>
"""
"""Its geoms and sites belong to the world, so that the ids of all others change."""

FAR = {"pose": {"position": {"x": 500.0}, "orientation": {"w": 1.0}}}
SCAN = {"frame_name": "base", "min_angle": 0.0, "max_angle": 0.35, "angle_increment": 0.35}
LIDAR = {"site": "mast", "resolution": [16, 1], "azimuth_range": [-1.0, 1.0], "elevation_range": [0.0],
         "max_range": 20.0, "update_rate": 50.0, "topic": "/top", "noise_std": 0.01}  # fmt: skip
WHEELS = {"wheels": ("left", "right"), "wheel_radius": 0.1, "cmd_vel_topic": "/car/cmd_vel"}
GAINS = {"position": {"wrist": {"p": 4.0, "i": 1.0, "d": 0.5}}}
PLUGINS = {
    "heart": (Heartbeat, {}),
    "fjs": (FreeJointStatePublisher, {}),
    "joints": (JointStatePublisher, {"joints": ("shoulder", "wrist", "left", "right")}),
    "commands": (JointCommands, {"joints": ("shoulder", "wrist"), "pid_gains": GAINS}),
    "base": (BaseVelocity, {"body": "base", "cmd_timeout": 5.0}),
    "drive": (DiffDrive, WHEELS | {"cmd_timeout": 5.0}),
    "odom": (OdometryPublisher, {"body": "base"}),
    "wrench": (ExternalWrench, {}),
    "sensors": (Sensors, {"noise": True}),
    "rays": (RangefinderLidar, {"front": SCAN, "lidar_publish_rate": 20.0}),
    "lidar": (Lidar, {"top": LIDAR}),
    "tf": (Transforms, {}),
    "description": (RobotDescription, {}),
}


def yard(tmp_path, *names):
    world = StandardWorld(SCENE)
    file = tmp_path / "robot.urdf"
    file.write_text("<robot name='r'><link name='base'/></robot>")
    for name in names or PLUGINS:
        plugin, parameters = PLUGINS[name]
        extra = {"file": str(file)} if name == "description" else {}
        world.add(plugin, name, **parameters, **extra)
    return world


def command(world):
    """Gives every plugin work that lasts for more than a second."""
    world.publish("/base/cmd_vel", Twist(linear=Vector3(x=0.3), angular=Vector3(z=0.5)))
    world.publish("/car/cmd_vel", Twist(linear=Vector3(x=0.2), angular=Vector3(z=0.3)))
    world.publish("/commands/joint_commands", JointState(name=["wrist"], position=[0.7]))
    points = [
        JointTrajectoryPoint(positions=[angle], time_from_start=Duration(sec=s)) for s, angle in ((1, 0.5), (2, 1))
    ]
    world.publish("/commands/joint_trajectory", JointTrajectory(joint_names=["shoulder"], points=points))
    held = request(push("spare", force=(1, 2, 3), duration=1.5, ramp=0.5), push("hand", force=(0, 0, 2), duration=3))
    return world.call("/wrench/apply_wrench", held)


def values(message, kept):
    """The numbers of a message in order, without the elements that belong to something new."""
    if isinstance(message, dict):
        return [leaf for part in message.values() for leaf in values(part, kept)]
    if isinstance(message, list | tuple):
        return [leaf for part in message if kept(part) for leaf in values(part, kept)]
    if isinstance(message, bytes):
        return list(message)
    return [message]


def is_old(part):
    return "x/" not in repr(part)


def without_stamps(message):
    for transform in message.get("transforms", ()):
        transform["header"]["stamp"] = {}
    return message


def same_messages(changed, plain, topic):
    mine, theirs = ([message.model_dump() for message in world.published(topic)] for world in (changed, plain))
    if topic in ("/tf_static", "/robot_description"):
        # Published once, and again after each change.
        assert len(mine) == 3
        mine, theirs = ([without_stamps(messages[-1])] for messages in (mine, theirs))
    assert len(mine) == len(theirs), topic
    for one, other in zip(mine, theirs, strict=True):
        ours, yours = values(one, is_old), values(other, is_old)
        assert len(ours) == len(yours), (topic, one, other)
        texts = [(a, b) for a, b in zip(ours, yours, strict=True) if isinstance(a, str)]
        assert all(a == b for a, b in texts)
        numbers = [[x for x in leaves if not isinstance(x, str)] for leaves in (ours, yours)]
        np.testing.assert_allclose(*numbers, rtol=1e-9, atol=1e-11, err_msg=topic)


def test_every_plugin_publishes_the_same_as_without_the_change(tmp_path):
    changed, plain = yard(tmp_path), yard(tmp_path)
    topics = [name for name in plain.transport.publishers if not ("/_action/" in name or name.startswith("/mjplug/"))]
    calls = [command(world) for world in (changed, plain)]
    for world in (changed, plain):
        world.step(133)
    assert changed.spawn("x", NEW, initial_pose=FAR).result.result == 1
    for world in (changed, plain):
        world.step(400)
    assert changed.code("DeleteEntity", entity="x")[0] == 1
    for world in (changed, plain):
        world.step(600)
    assert changed.simulation.generation == 2
    assert not [topic for topic in topics if not plain.published(topic)]
    for topic in topics:
        if topic not in ("/wrench/wrench_markers", "/clock"):
            same_messages(changed, plain, topic)
    assert not any(call.answered for call in calls)
    for world in (changed, plain):
        world.step(400)
    assert [call.response for call in calls] == [calls[1].response] * 2
    assert calls[0].response.success
    np.testing.assert_allclose(changed.data.qpos, plain.data.qpos, rtol=1e-9, atol=1e-11)


def test_new_frames_and_bodies_are_published(tmp_path):
    world = yard(tmp_path, "tf", "fjs", "sensors", "commands")
    world.spawn("x", NEW, initial_pose=FAR)
    world.step(200)
    assert "x/body" in {t.child_frame_id for t in world.published("/tf")[-1].transforms}
    assert "x/body" in {state.name for state in world.published("/fjs/free_joint_states")[-1].free_joints}
    assert world.published("/sensors/x_own/imu")[-1].angular_velocity.x == pytest.approx(0.0, abs=1e-6)
    world.ask("DeleteEntity", entity="x")
    world.step(200)
    assert "x/body" not in {t.child_frame_id for t in world.published("/tf")[-1].transforms}
    before = len(world.published("/sensors/x_own/imu"))
    world.step(200)
    assert len(world.published("/sensors/x_own/imu")) == before


def test_a_wrench_on_a_removed_body_ends_with_a_reason_and_others_continue(tmp_path):
    world = yard(tmp_path, "wrench")
    gone = world.call("/wrench/apply_wrench", request(push("spare", force=(1, 0, 0), duration=9)))
    stays = world.call("/wrench/apply_wrench", request(push("car", force=(1, 0, 0), duration=1)))
    both = world.call(
        "/wrench/apply_wrench", request(push("spare", duration=1), push("car", force=(0, 1, 0), duration=1))
    )
    world.step(10)
    assert world.code("DeleteEntity", entity="spare")[0] == 1
    assert gone.refusal == "the wrench has ended, because body 'spare' was removed"
    assert not stays.answered
    world.step(1)
    assert world.data.xfrc_applied[world.model.body("car").id, 0] == 1.0
    world.step(600)
    assert stays.response.success
    assert both.refusal == "the wrench has ended, because body 'spare' was removed"


def test_a_plugin_whose_robot_is_removed_is_disabled_until_it_is_back(tmp_path, caplog):
    world = yard(tmp_path, "base", "odom", "heart")
    world.publish("/base/cmd_vel", Twist(linear=Vector3(x=0.3)))
    world.step(10)
    with caplog.at_level(logging.ERROR):
        assert world.code("DeleteEntity", entity="base")[0] == 1
    assert "plugin base does not fit the changed model: unknown body" in caplog.text
    world.publish("/base/cmd_vel", Twist(linear=Vector3(x=0.3)))
    before = len(world.published("/odom"))
    world.step(500)
    assert len(world.published("/odom")) == before
    assert len(world.published("/mujoco_heartbeat")) >= 1
    assert world.code("ResetSimulation", scope=255)[0] == 1
    world.publish("/base/cmd_vel", Twist(linear=Vector3(x=0.3)))
    world.step(500)
    assert len(world.published("/odom")) > before
    assert world.data.body("base").xpos[0] > 0.1


def test_a_camera_sees_what_is_added_and_its_topic_stays(gl):  # noqa: F811
    world = StandardWorld(SCENE)
    world.add(Camera, "cameras", camera_publish_rate=50.0)
    publisher = world.transport.publishers["/cameras/eye/color"]
    world.step(100)
    before = world.published("/cameras/eye/color")[-1]
    ball = "<mujoco><worldbody><geom type='box' size='1 1 1' rgba='1 0 0 1'/></worldbody></mujoco>"
    seen = {"pose": {"position": {"z": 3.0}, "orientation": {"w": 1.0}}}
    first = world.workers.workers["cameras"]
    assert world.spawn("ball", ball, initial_pose=seen).result.result == 1
    assert first.stopped
    assert world.workers.workers["cameras"] is not first
    world.step(100)
    after = world.published("/cameras/eye/color")[-1]
    assert world.transport.publishers["/cameras/eye/color"] is publisher
    assert after.data != before.data
    world.ask("DeleteEntity", entity="ball")
    world.step(100)
    np.testing.assert_allclose(
        np.frombuffer(world.published("/cameras/eye/color")[-1].data, np.uint8).astype(int),
        np.frombuffer(before.data, np.uint8).astype(int),
        atol=40,
    )
    world.workers.close()


def test_a_trigger_that_waits_for_an_image_is_refused_when_the_model_changes(gl):  # noqa: F811
    world = StandardWorld(SCENE)
    world.add(Camera, "cameras", eye={"policy": "polled"})
    world.workers.workers["cameras"].hold()
    call = world.call("/cameras/eye/trigger")
    world.spawn("x", NEW)
    assert call.refusal == "cancelled: the model has changed"
    again = world.call("/cameras/eye/trigger")
    for _ in range(10):
        world.step(0)
    assert again.response.success
    world.workers.close()


class Own(Plugin[Parameters]):
    """A plugin of a user with its own way to follow."""

    def init(self, host, parameters):
        self.host, self.changes = host, []
        self.body = host.body_id("car")
        self.hold = host.create_velocity_hold((0,))
        if "broken" in host.name and host.model.nbody > 8 + 1:
            raise PluginError("too many bodies")

    def on_model_changed(self, change):
        self.changes.append(change)
        self.body = int(change.maps["body"][self.body])


def test_a_plugin_gets_the_new_ids():
    world = StandardWorld(SCENE)
    plugin = world.add(Own)
    world.ask("DeleteEntity", entity="spare")
    (change,) = plugin.changes
    assert plugin.host.model is world.model
    assert plugin.body == world.model.body("car").id
    assert (change.generation, change.removed) == (1, ("spare",))
    assert change.maps["body"][2] == -1
    assert change.maps["joint"].tolist() == [0, -1, 1, 2, 3, 4, 5]


class Failing(Plugin[Parameters]):
    """A plugin whose restart fails in its own code."""

    def init(self, host, parameters):
        self.host = host
        host.create_timer(0.01, lambda: None)
        if host.model.nbody > 8:
            raise ZeroDivisionError("bad luck")


def test_a_plugin_that_fails_with_the_changed_model_is_disabled_and_the_server_continues(caplog):
    world = StandardWorld(SCENE)
    plugin = world.add(Failing)
    with caplog.at_level(logging.ERROR):
        assert world.spawn("x", NEW).result.result == 1
    assert "bad luck" in caplog.text
    assert "plugin test failed with the changed model" in plugin.host._guard.disabled
    world.step(100)
    world.ask("DeleteEntity", entity="x")
    assert plugin.host._guard.disabled == ""
