"""Odometry of moving bases, against motions known by hand and against mj_objectVelocity."""

import math

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.odometry import OdometryPublisher

FLOATING = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="base" pos="1 2 3"><freejoint/><geom type="box" size=".1 .2 .3" pos="0 0 0"/></body>
  </worldbody>
</mujoco>
"""

PLANAR = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="base" pos="0 0 .2">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <joint name="yaw" axis="0 0 1"/><geom type="box" size=".1 .2 .1"/>
      <body name="mast" pos=".5 0 1"><joint name="tilt" axis="0 1 0"/><geom size=".05" pos="0 0 .3"/></body></body>
  </worldbody>
</mujoco>
"""


def world_of(xml=FLOATING, rate=500.0, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.add(OdometryPublisher, "odometry", rate=rate, **parameters)
    return world


def last(world, topic="/odom"):
    return world.published(topic)[-1]


def xyz(vector):
    return np.array((vector.x, vector.y, vector.z))


def wxyz(quaternion):
    return np.array((quaternion.w, quaternion.x, quaternion.y, quaternion.z))


def test_a_base_that_drives_a_circle_reads_a_constant_forward_velocity_in_its_own_frame():
    world = world_of()
    speed, rate = 2.0, 1.5
    # Turned by a quarter already: its forward is the world's y.
    world.data.qpos[3:7] = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    heading = math.pi / 2
    for _ in range(200):
        # On a circle, the velocity turns with the heading.
        world.data.qvel[:] = (speed * math.cos(heading), speed * math.sin(heading), 0.0, 0.0, 0.0, rate)
        world.loop.step(1)
        heading += rate * 0.002
    message = last(world)
    # The last velocity was that of the heading before the last step, which turned on by 3 mrad.
    assert xyz(message.twist.twist.linear) == pytest.approx((speed, 0.0, 0.0), abs=speed * rate * 0.002 * 1.01)
    assert xyz(message.twist.twist.angular) == pytest.approx((0.0, 0.0, rate))
    radius = speed / rate
    angle = heading - math.pi / 2
    expected = np.array((1.0, 2.0, 3.0)) + (radius * (math.cos(angle) - 1.0), radius * math.sin(angle), 0.0)
    assert xyz(message.pose.pose.position) == pytest.approx(expected, abs=2e-3)
    assert wxyz(message.pose.pose.orientation) == pytest.approx(
        (math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)), abs=1e-9
    )
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base")


def test_both_velocities_are_in_the_frame_of_the_base_however_it_is_turned():
    world = world_of()
    half = math.sqrt(0.5)
    # Lying on its back: its z axis is the world's -x, its x axis the world's z.
    world.data.qpos[3:7] = (half, 0.0, -half, 0.0)
    # MuJoCo has the linear velocity in the world's axes, and the angular velocity in the body's.
    world.data.qvel[:] = (0.0, 0.0, 4.0, 5.0, 0.0, 0.0)
    world.loop.step(10)
    twist = last(world).twist.twist
    assert xyz(twist.linear) == pytest.approx((4.0, 0.0, 0.0), abs=1e-9)
    assert xyz(twist.angular) == pytest.approx((5.0, 0.0, 0.0))


@pytest.mark.parametrize(("xml", "body"), [(FLOATING, "base"), (PLANAR, "base"), (PLANAR, "mast")])
def test_the_numbers_are_those_that_mujoco_has_of_the_body_at_the_stamp(xml, body):
    world = world_of(xml, body=body)
    random = np.random.default_rng(1)
    world.data.qvel[:] = random.normal(size=world.model.nv)
    for k in range(1, 101):
        world.loop.step(1)
        message = last(world)
        assert message.header.stamp.to_ns() == 2_000_000 * k
        data = mujoco.MjData(world.model)
        data.qpos[:], data.qvel[:] = world.data.qpos, world.data.qvel
        mujoco.mj_forward(world.model, data)
        found = np.empty(6)
        which = world.model.body(body).id
        mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_XBODY, which, found, 1)
        assert xyz(message.twist.twist.angular) == pytest.approx(found[:3], abs=1e-12)
        assert xyz(message.twist.twist.linear) == pytest.approx(found[3:], abs=1e-12)
        assert xyz(message.pose.pose.position) == pytest.approx(data.xpos[which], abs=1e-12)
        assert wxyz(message.pose.pose.orientation) == pytest.approx(data.xquat[which], abs=1e-12)


def test_subscribing_to_the_odometry_does_not_change_the_motion():
    ends = []
    for matched in (True, False):
        world = world_of(PLANAR, body="mast")
        world.transport.publishers["/odom"].matched = matched
        world.data.qvel[:] = (1.0, 2.0, 3.0, 4.0)
        world.loop.step(300)
        ends.append(world.data.qpos.copy())
    assert np.array_equal(*ends)


def test_odometry_may_start_at_zero_and_does_so_after_each_reset():
    world = world_of(PLANAR, body="base", origin="start")
    world.data.qpos[:3] = (1.0, 2.0, math.pi / 2)
    world.simulation.mark_poses_outdated()
    world.simulation.keep_as_initial()
    world.loop.reset(Reset())
    world.data.qvel[:3] = (0.0, 1.0, 0.5)
    world.loop.step(100)
    message = last(world)
    # Its forward was the world's y.
    assert xyz(message.pose.pose.position) == pytest.approx((0.2, 0.0, 0.0), abs=1e-3)
    turned = 0.5 * 0.2
    assert wxyz(message.pose.pose.orientation) == pytest.approx(
        (math.cos(turned / 2), 0.0, 0.0, math.sin(turned / 2)), abs=1e-3
    )
    world.loop.reset(Reset())
    world.loop.step(1)
    assert xyz(last(world).pose.pose.position) == pytest.approx((0.0,) * 3)


def test_the_transform_equals_the_pose_in_the_message():
    names = {"frame_id": "map", "child_frame_id": "base_link", "topic": "/simulator/floating_base_state"}
    world = world_of(publish_tf=True, **names)
    world.data.qvel[:] = (1.0, 2.0, 3.0, 1.0, 2.0, 3.0)
    world.loop.step(50)
    (transform,), odometry = last(world, "/tf").transforms, last(world, "/simulator/floating_base_state")
    assert transform.header == odometry.header
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
    assert odometry.child_frame_id == "base_link"
    assert xyz(transform.transform.translation) == pytest.approx(xyz(odometry.pose.pose.position), abs=0.0)
    assert wxyz(transform.transform.rotation) == pytest.approx(wxyz(odometry.pose.pose.orientation), abs=0.0)


@pytest.mark.parametrize("deaf", ["/tf", "/odom"])
def test_only_topics_with_subscribers_are_published(deaf):
    world = world_of(publish_tf=True)
    world.transport.publishers[deaf].matched = False
    world.loop.step(5)
    assert {name: len(publisher.messages) for name, publisher in world.transport.publishers.items()} == {
        "/odom": 5, "/tf": 5, deaf: 0,
    }  # fmt: skip


def test_without_asking_there_is_no_transform_and_covariances_are_as_configured():
    world = world_of(pose_covariance=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], twist_covariance=[0.0] * 5 + [9.0])
    world.loop.step(1)
    assert set(world.transport.publishers) == {"/odom"}
    assert np.array_equal(np.reshape(last(world).pose.covariance, (6, 6)), np.diag((1.0, 2.0, 3.0, 4.0, 5.0, 6.0)))
    assert np.array_equal(np.reshape(last(world).twist.covariance, (6, 6)), np.diag((0.0,) * 5 + (9.0,)))


@pytest.mark.parametrize("name", ["mobile_base", "quadruped"])
def test_the_models_that_come_along_have_a_base(name):
    world = World(load_model(f"bundled:{name}").model)
    world.add(OdometryPublisher, "odometry")
    world.loop.step(100)
    assert world.published("/odom")


def test_a_base_that_is_not_clear_stops_the_start():
    with pytest.raises(MjplugError, match="the model has no body with a free joint; set `body`"):
        world_of(PLANAR)
    two = FLOATING.replace("</worldbody>", '<body><freejoint/><geom size=".1"/></body></worldbody>')
    with pytest.raises(MjplugError, match="bodies with a free joint: base, a body without a name"):
        world_of(two)
    with pytest.raises(MjplugError, match="unknown body 'bse', did you mean 'base'"):
        world_of(body="bse")


@pytest.mark.parametrize(
    "wrong", [{"rate": 0.0}, {"pose_covariance": [1.0]}, {"twist_covariance": [-1.0] * 6}, {"origin": "here"}]
)
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ValidationError):
        OdometryPublisher.parameters_type(**wrong)
