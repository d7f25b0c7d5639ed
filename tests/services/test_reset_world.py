import math

import mujoco
import numpy as np
import pytest

from mjplug.services import reset_world
from mjplug.testing import World
from mjplug_schemas.geometry_msgs import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState, ResetWorld, SimulationState
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header


@pytest.fixture
def world(arm_model):
    world = World(arm_model)
    reset_world.offer(world.host("mjplug"), world.loop)
    world.loop.step(200)
    return world


def joints(**parts):
    return SimulationState(joint_states=JointState(**parts))


def ask(world, keyframe="", overrides=None):
    return world.call(
        "/mjplug/reset_world", ResetWorld.Request(keyframe=keyframe, state_overrides=overrides or SimulationState())
    )


def joint(world, name):
    return world.data.joint(name)


def test_without_arguments_the_initial_state_comes_back(world, arm_model):
    call = ask(world)
    data = mujoco.MjData(arm_model)
    mujoco.mj_forward(arm_model, data)
    assert call.response == ResetWorld.Response(success=True, message="the world was reset to its initial state")
    assert np.array_equal(world.data.qpos, data.qpos)
    assert np.array_equal(world.data.qvel, data.qvel)
    assert np.array_equal(world.data.act, data.act)
    assert np.array_equal(world.data.xpos, data.xpos)
    assert world.simulation.time_ns == 400_000_000


def test_a_keyframe_brings_its_positions_controls_and_activations_but_not_its_time(world, arm_model):
    call = ask(world, "bent")
    assert call.response.message == "the world was reset to keyframe 'bent'"
    assert np.array_equal(world.data.qpos, arm_model.key_qpos[0])
    assert np.array_equal(world.data.ctrl, [0.5, 0.3])
    assert np.array_equal(world.data.act, [0.25])
    assert world.data.time == pytest.approx(0.4)


def test_joint_overrides_set_positions_and_velocities_on_top(world):
    call = ask(world, overrides=joints(name=["elbow", "extension"], position=[0.4, 0.15], velocity=[1.0, -0.5]))
    assert call.response.message == "the world was reset to its initial state with 2 joint overrides"
    assert joint(world, "elbow").qpos[0] == 0.4
    assert joint(world, "extension").qpos[0] == 0.15
    assert joint(world, "elbow").qvel[0] == 1.0
    assert joint(world, "extension").qvel[0] == -0.5


def test_frames_of_free_bodies_are_those_after_the_reset_and_the_joint_overrides(world, arm_model):
    state = FreeJointState(
        name="cube",
        pose=PoseStamped(header=Header(frame_id="lower"), pose=Pose(position=Point(x=0.1, y=0.2, z=0.3))),
        twist=TwistStamped(header=Header(frame_id="lower"), twist=Twist(linear=Vector3(x=1.0))),
    )
    overrides = SimulationState(joint_states=JointState(name=["shoulder"], position=[-0.6]), free_joints=[state])
    call = ask(world, overrides=overrides)
    assert call.refusal is None
    assert (
        call.response.message
        == "the world was reset to its initial state with 1 joint override and 1 free body override"
    )
    data = mujoco.MjData(arm_model)
    data.joint("shoulder").qpos[0] = -0.6
    mujoco.mj_kinematics(arm_model, data)
    frame = data.body("lower").xmat.reshape(3, 3)
    assert np.allclose(
        joint(world, "cube_free").qpos[:3], data.body("lower").xpos + frame @ [0.1, 0.2, 0.3], atol=1e-14
    )
    assert np.allclose(joint(world, "cube_free").qvel[:3], frame @ [1, 0, 0], atol=1e-14)
    assert np.allclose(world.data.body("cube").xpos, joint(world, "cube_free").qpos[:3])


def nan_state():
    return FreeJointState(name="cube", pose=PoseStamped(pose=Pose(position=Point(x=math.nan))))


REFUSED = [
    ("keyframe", {"keyframe": "bnt"}, "unknown keyframe 'bnt', did you mean 'bent'?; known: bent"),
    (
        "unknown joint",
        {"overrides": joints(name=["elbow", "elbo"], position=[0.0, 0.0])},
        "joint_states[1] ('elbo'): unknown joint 'elbo', did you mean 'elbow'?; "
        "known: cube_free, elbow, extension, shoulder, socket",
    ),
    (
        "free joint",
        {"overrides": joints(name=["cube_free"], position=[0.0])},
        "joint_states[0] ('cube_free'): this is a free joint; set its body's state in state_overrides.free_joints",
    ),
    (
        "ball joint",
        {"overrides": joints(name=["socket"], position=[0.0])},
        "joint_states[0] ('socket'): this is a ball joint; only hinge and slide joints can be overridden",
    ),
    (
        "range",
        {"overrides": joints(name=["extension"], position=[0.3])},
        "joint_states[0] ('extension'): position 0.3 is outside the joint's range [0, 0.2]",
    ),
    (
        "nan velocity",
        {"overrides": joints(name=["elbow"], velocity=[math.nan])},
        "joint_states[0] ('elbow'): velocity is nan; it must be finite",
    ),
    (
        "twice",
        {"overrides": joints(name=["elbow", "elbow"], position=[0.0, 0.1])},
        "joint_states[1] ('elbow'): duplicate of joint_states[0]; list each joint once",
    ),
    (
        "lengths",
        {"overrides": joints(name=["elbow"], position=[0.0, 1.0])},
        "joint_states.position has 2 entries for 1 names; give one for each name, or none",
    ),
    (
        "effort",
        {"overrides": joints(name=["elbow"], effort=[1.0])},
        "joint_states.effort cannot be set by a reset; leave it empty",
    ),
    (
        "nan body",
        {"overrides": SimulationState(free_joints=[nan_state()])},
        "free_joints[0] ('cube'): pose.pose.position is (nan, 0, 0); every component must be finite",
    ),
]


@pytest.mark.parametrize(("arguments", "reason"), [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED])
def test_a_wrong_request_is_refused_whole_and_touches_nothing(world, arguments, reason):
    before = [np.copy(a) for a in (world.data.qpos, world.data.qvel, world.data.act, world.data.ctrl)]
    call = ask(world, **arguments)
    assert call.refusal == f"{reason}; the world was not reset"
    after = (world.data.qpos, world.data.qvel, world.data.act, world.data.ctrl)
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    assert world.simulation.epoch == 0


def test_a_reset_does_not_change_whether_the_simulation_is_paused(world):
    ask(world)
    assert not world.loop.paused
    world.loop.pause()
    ask(world)
    assert world.loop.paused


def test_a_quaternion_of_any_length_is_normalised(world):
    state = FreeJointState(
        name="cube", pose=PoseStamped(pose=Pose(orientation=Quaternion(w=0.0, x=0.0, y=3e150, z=4e150)))
    )
    ask(world, overrides=SimulationState(free_joints=[state]))
    assert np.allclose(joint(world, "cube_free").qpos[3:], [0, 0, 0.6, 0.8], atol=1e-15)
