"""The frame that a message names is the one that its numbers are in, as TF has it."""

import logging
import math

import mujoco
import numpy as np
import pytest

from mjplug.testing import World
from mjplug_plugins.sensors import Sensors
from mjplug_plugins.transforms import Transforms

SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="head" pos="1 2 3" euler=".3 .2 .1">
      <joint name="pan" axis="0 0 1"/>
      <inertial pos=".1 .2 .3" euler=".4 .5 .6" mass="1" diaginertia="1 2 2.5"/>
      <camera name="eye" pos=".1 0 .2" euler=".5 -.3 .2"/><site name="mount" pos="0 .1 0" euler=".1 0 0"/></body>
    <body name="thing" pos="0 1 5" euler="1 2 3"><joint name="swing" type="ball"/><geom size=".1" pos="0 .1 0"/>
      <site name="mark" pos=".1 .2 .3" euler=".3 .2 .1"/></body>
  </worldbody>
  <sensor>
    <framepos name="seen_pos" objtype="site" objname="mark" reftype="REFTYPE" refname="REFNAME" noise="1e-9"/>
    <framequat name="seen_quat" objtype="site" objname="mark" reftype="REFTYPE" refname="REFNAME" noise="1e-9"/>
    <framelinvel name="moving" objtype="site" objname="mark" reftype="REFTYPE" refname="REFNAME"/>
    <framepos name="place" objtype="site" objname="mark" reftype="REFTYPE" refname="REFNAME"/>
    <ballangvel name="swinging" joint="swing"/>
  </sensor>
</mujoco>
"""


def xyz(vector):
    return np.array((vector.x, vector.y, vector.z))


def matrix(turn):
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array((turn.w, turn.x, turn.y, turn.z)))
    return rotation.reshape(3, 3)


def in_world(world, name):
    """Returns a frame's pose by going up to the root, as tf2 does."""
    messages = world.published("/tf")[-1], world.published("/tf_static")[-1]
    links = {link.child_frame_id: link for message in messages for link in message.transforms}
    position, rotation = np.zeros(3), np.eye(3)
    while name != "world":
        link = links[name]
        turn = matrix(link.transform.rotation)
        position, rotation = xyz(link.transform.translation) + turn @ position, turn @ rotation
        name = link.header.frame_id
    return position, rotation


def world_of(reftype, refname, **parameters):
    model = mujoco.MjModel.from_xml_string(SCENE.replace("REFTYPE", reftype).replace("REFNAME", refname))
    world = World(model)
    world.add(Sensors, "sensors", rate=500.0, discover=["pose", "vector"], place={"type": "vector"}, **parameters)
    world.add(Transforms, "frames", rate=500.0)
    return world


@pytest.mark.parametrize("noise", [False, True])
@pytest.mark.parametrize(
    ("reftype", "refname", "frame"),
    [("camera", "eye", "eye_frame"), ("body", "head", "head"), ("xbody", "head", "head"), ("site", "mount", "mount")],
)
def test_a_pose_is_in_the_frame_of_its_reference_as_tf_has_it(reftype, refname, frame, noise):
    world = world_of(reftype, refname, noise=noise)
    world.data.joint("pan").qpos[0] = 0.7
    world.loop.step(2)
    pose, place = (world.published(f"/sensors/{topic}")[-1] for topic in ("seen/pose", "place/vector"))
    assert pose.header.frame_id == place.header.frame_id == frame
    position, rotation = in_world(world, frame)
    site = world.data.site("mark")
    assert position + rotation @ xyz(pose.pose.position) == pytest.approx(site.xpos, abs=1e-7)
    assert rotation @ matrix(pose.pose.orientation) == pytest.approx(site.xmat.reshape(3, 3), abs=1e-7)
    assert position + rotation @ xyz(place.vector) == pytest.approx(site.xpos, abs=1e-9)


@pytest.mark.parametrize(
    ("reftype", "refname", "frame"),
    [("camera", "eye", "eye_frame"), ("body", "head", "head"), ("xbody", "head", "head")],
)
def test_a_velocity_is_in_the_axes_of_its_reference(reftype, refname, frame):
    world = world_of(reftype, refname)
    world.data.joint("swing").qvel[:] = (1.0, 2.0, 3.0)
    mujoco.mj_forward(world.model, world.data)
    # The head rests, so the velocity is that in the world, turned.
    found = np.empty(6)
    site = world.model.site("mark").id
    mujoco.mj_objectVelocity(world.model, world.data, mujoco.mjtObj.mjOBJ_SITE, site, found, 0)
    world.loop.step(1)
    moving = world.published("/sensors/moving/vector")[-1]
    assert moving.header.frame_id == frame
    assert in_world(world, frame)[1] @ xyz(moving.vector) == pytest.approx(found[3:], abs=1e-9)


def test_a_ball_joint_turns_in_the_axes_of_its_body():
    world = world_of("xbody", "head")
    world.data.joint("swing").qpos[:] = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    world.data.joint("swing").qvel[:] = (1.0, 2.0, 3.0)
    world.loop.step(1)
    message = world.published("/sensors/swinging/vector")[-1]
    assert message.header.frame_id == "thing"
    assert xyz(message.vector) == pytest.approx((1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ('refname="REFNAME" noise="1e-9"/>\n    <framelinvel', 'refname="REFNAME"/>\n    <framelinvel', ""),
        (
            'objname="mark" reftype="REFTYPE" refname="REFNAME" noise="1e-9"/>\n    <framelinvel',
            'objname="mark"/>\n    <framelinvel',
            "pose 'seen': seen_pos and seen_quat have different objects or references",
        ),
        (
            "<sensor>",
            '<sensor><gyro name="two_gyro" site="mark"/><accelerometer name="two_accel" site="mount"/>',
            "imu 'two': two_gyro and two_accel have different sites",
        ),
    ],
)
def test_parts_that_are_not_at_one_place_are_reported(old, new, names, caplog):
    assert old in SCENE
    xml = SCENE.replace(old, new).replace("REFTYPE", "xbody").replace("REFNAME", "head")
    world = World(mujoco.MjModel.from_xml_string(xml))
    with caplog.at_level(logging.WARNING):
        world.add(Sensors, "sensors")
    assert [
        record.getMessage().removesuffix(": the message is in the frame of the first") for record in caplog.records
    ] == ([names] if names else [])
