import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mjplug.services import set_free_joint_state
from mjplug.testing import World
from mjplug_schemas.geometry_msgs import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState, SetFreeJointState
from mjplug_schemas.std_msgs import Header

NAME = "/mjplug/set_free_joint_state"


@pytest.fixture
def world(arm_model):
    world = World(arm_model)
    set_free_joint_state.offer(world.host("mjplug"), world.loop)
    return world


def state(
    name="cube",
    pos=(0, 0, 1),
    quat_xyzw=(0, 0, 0, 1),
    linear=(0, 0, 0),
    angular=(0, 0, 0),
    pose_frame="",
    twist_frame="",
):
    point, (x, y, z, w) = Point(**dict(zip("xyz", map(float, pos), strict=True))), map(float, quat_xyzw)
    vectors = [Vector3(**dict(zip("xyz", map(float, v), strict=True))) for v in (linear, angular)]
    return FreeJointState(
        name=name,
        pose=PoseStamped(
            header=Header(frame_id=pose_frame), pose=Pose(position=point, orientation=Quaternion(x=x, y=y, z=z, w=w))
        ),
        twist=TwistStamped(header=Header(frame_id=twist_frame), twist=Twist(linear=vectors[0], angular=vectors[1])),
    )


def ask(world, *states):
    return world.call(NAME, SetFreeJointState.Request(free_joints=list(states)))


def world_velocity(world, body):
    """Linear and angular velocity of a body's frame in world axes, by MuJoCo itself."""
    velocity = np.empty(6)
    mujoco.mj_forward(world.model, world.data)
    mujoco.mj_objectVelocity(world.model, world.data, mujoco.mjtObj.mjOBJ_XBODY, world.model.body(body).id, velocity, 0)
    return velocity[3:], velocity[:3]


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 0.01)
three = st.tuples(*[st.floats(-5, 5)] * 3)


@pytest.fixture(scope="module")
def shared_world():
    from conftest import ARM

    world = World(mujoco.MjModel.from_xml_string(ARM))
    set_free_joint_state.offer(world.host("mjplug"), world.loop)
    world.loop.step(100)
    return world


@given(pos=three, quat=unit, linear=three, angular=three)
def test_velocities_given_in_the_world_frame_are_the_body_s_world_velocities(shared_world, pos, quat, linear, angular):
    assert ask(shared_world, state(pos=pos, quat_xyzw=quat, linear=linear, angular=angular)).response.success
    got_linear, got_angular = world_velocity(shared_world, "cube")
    assert np.allclose(got_linear, linear, atol=1e-12)
    assert np.allclose(got_angular, angular, atol=1e-12)
    assert np.allclose(shared_world.data.body("cube").xpos, pos, atol=1e-14)


@given(pos=three, quat=unit, linear=three, angular=three)
def test_poses_and_velocities_in_a_body_s_frame_are_turned_into_the_world(shared_world, pos, quat, linear, angular):
    frame_r = shared_world.data.body("lower").xmat.reshape(3, 3)
    mujoco.mj_kinematics(shared_world.model, shared_world.data)
    frame_p, frame_r = shared_world.data.body("lower").xpos.copy(), frame_r.copy()
    ask(
        shared_world,
        state(pos=pos, quat_xyzw=quat, linear=linear, angular=angular, pose_frame="lower", twist_frame="lower"),
    )
    got_linear, got_angular = world_velocity(shared_world, "cube")
    x, y, z, w = np.array(quat) / np.linalg.norm(quat)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array([w, x, y, z]))
    assert np.allclose(shared_world.data.body("cube").xpos, frame_p + frame_r @ pos, atol=1e-12)
    assert np.allclose(shared_world.data.body("cube").xmat.reshape(3, 3), frame_r @ rotation.reshape(3, 3), atol=1e-12)
    assert np.allclose(got_linear, frame_r @ linear, atol=1e-12)
    assert np.allclose(got_angular, frame_r @ angular, atol=1e-12)


def test_frames_are_current_while_the_simulation_runs(world):
    world.loop.step(50)
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_kinematics(world.model, data)
    ask(world, state(pos=(0, 0, 0), pose_frame="lower"))
    assert np.array_equal(world.data.joint("cube_free").qpos[:3], data.body("lower").xpos)


def test_entries_of_one_request_do_not_influence_each_other(world):
    brick = world.data.body("brick").xpos.copy()
    ask(world, state("brick", pos=(4, 4, 4)), state("cube", pos=(0, 0, 1), pose_frame="brick"))
    assert np.allclose(world.data.joint("cube_free").qpos[:3], brick + [0, 0, 1], atol=1e-15)


def test_everything_derived_is_up_to_date_when_the_answer_comes(world):
    call = ask(world, state(pos=(7, 8, 9)))
    assert call.response == SetFreeJointState.Response(success=True, message="set the state of 1 body")
    assert np.array_equal(world.data.body("cube").xpos, [7, 8, 9])
    assert world.simulation.step == 0


def test_an_empty_request_succeeds_and_changes_nothing(world):
    before = world.data.qpos.copy()
    assert ask(world).response == SetFreeJointState.Response(success=True, message="set the state of 0 bodies")
    assert np.array_equal(before, world.data.qpos)


REFUSED = [
    (state("cub"), "unknown body with a free joint 'cub', did you mean 'cube'?; known: brick, cube"),
    (state("lower"), "body 'lower' has no free joint"),
    (
        state(pose_frame="x"),
        "pose.header.frame_id: unknown body 'x'; known: brick, cube, lower, pendulum, slider, upper, world",
    ),
    (
        state(twist_frame="x"),
        "twist.header.frame_id: unknown body 'x'; known: brick, cube, lower, pendulum, slider, upper, world",
    ),
    (state(pos=(0, math.nan, 0)), "pose.pose.position is (0, nan, 0); every component must be finite"),
    (
        state(pos=(1e11, 0, 0)),
        "pose.pose.position is (1e+11, 0, 0); the absolute value of every component must be below 1e+10",
    ),
    (state(linear=(0, 0, math.inf)), "twist.twist.linear is (0, 0, inf); every component must be finite"),
    (state(angular=(math.nan, 0, 0)), "twist.twist.angular is (nan, 0, 0); every component must be finite"),
    (
        state(quat_xyzw=(0, 0, 0, 0)),
        "pose.pose.orientation is (x 0, y 0, z 0, w 0); a quaternion must be finite and its norm must not be zero",
    ),
    (
        state(quat_xyzw=(0, math.nan, 0, 1)),
        "pose.pose.orientation is (x 0, y nan, z 0, w 1); a quaternion must be finite and its norm must not be zero",
    ),
    (state("brick"), "duplicate of free_joints[0]; list each body once"),
]


@pytest.mark.parametrize(("bad", "reason"), REFUSED, ids=[reason[:40] for _, reason in REFUSED])
def test_one_wrong_entry_refuses_the_whole_request(world, bad, reason):
    before = world.data.qpos.copy()
    call = ask(world, state("brick", pos=(3, 3, 3)), bad)
    assert call.refusal == f"free_joints[1] ({bad.name!r}): {reason}"
    assert np.array_equal(before, world.data.qpos)
