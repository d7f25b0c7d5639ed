import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError
from mjplug.physics.reset import Reset
from mjplug.plugin.selection import select
from mjplug.services import set_free_joint_state
from mjplug.testing import World
from mjplug_plugins.base_velocity import BaseVelocity
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher, FreeJointStatePublisherParameters
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import SetFreeJointState

TOPIC, SERVICE = "/states/free_joint_states", "/mjplug/set_free_joint_state"

SCENE = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body name="swing" pos="0 0 2"><joint axis="1 2 3"/><geom type="box" size=".1 .2 .3" pos=".4 0 0"/>
      <body name="tip" pos=".8 .1 0" euler="20 30 40"><joint axis="0 1 0"/><geom type="capsule" size=".05 .2"/></body>
    </body>
    <body name="box" pos="3 0 1" euler="10 20 30"><freejoint name="box_free"/>
      <geom type="box" size=".1 .2 .3" pos=".05 0 .02"/></body>
    <body name="ball" pos="-3 0 1"><freejoint/><geom size=".1" pos="0 .3 0"/></body>
    <body name="brick" pos="0 3 1"><freejoint/><geom type="box" size=".3 .2 .1"/></body>
  </worldbody>
</mujoco>
"""

DOCUMENTED = """\
/**:
  ros__parameters:
    mujoco_plugins:
      free_joint_state_publisher:
        type: "mujoco_ros2_control_plugins/FreeJointStatePublisherPlugin"
        frame_id: ""              # world frame; set to a body name to publish relative poses
        body_names: []            # empty = all free-joint bodies
        topic: "free_joint_states"
        publish_rate: 50.0
"""


def scene(xml=SCENE, seed=1):
    """A world in which everything tumbles."""
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.data.qvel[:] = np.random.default_rng(seed).normal(size=world.model.nv)
    set_free_joint_state.offer(world.host("mjplug"), world.loop)
    return world


def publisher(world, **parameters):
    return world.add(FreeJointStatePublisher, "states", **{"publish_rate": 500.0, **parameters})


def messages(world):
    return world.published(TOPIC)


def numbers(state):
    """Position, quaternion (w, x, y, z), linear and angular velocity of an entry."""
    p, q, v = state.pose.pose.position, state.pose.pose.orientation, state.twist.twist
    return (
        np.array((p.x, p.y, p.z)),
        np.array((q.w, q.x, q.y, q.z)),
        np.array((v.linear.x, v.linear.y, v.linear.z)),
        np.array((v.angular.x, v.angular.y, v.angular.z)),
    )


def by_mujoco(world, name):
    """The same of a body, by MuJoCo itself, from the positions and velocities alone."""
    data = mujoco.MjData(world.model)
    data.qpos[:], data.qvel[:] = world.data.qpos, world.data.qvel
    mujoco.mj_forward(world.model, data)
    body, velocity = data.body(name), np.empty(6)
    mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_XBODY, body.id, velocity, 0)
    return body.xpos.copy(), body.xquat.copy(), velocity[3:], velocity[:3]


def matrix(quat_wxyz):
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, quat_wxyz)
    return axes.reshape(3, 3)


def test_in_the_world_frame_poses_and_both_velocities_are_those_of_the_world():
    world = scene()
    publisher(world)
    world.loop.step(300)
    message = messages(world)[-1]
    assert [state.name for state in message.free_joints] == ["box", "ball", "brick"]
    for state in message.free_joints:
        for got, expected in zip(numbers(state), by_mujoco(world, state.name), strict=True):
            assert np.abs(got - expected).max() < 1e-12
        assert np.linalg.norm(numbers(state)[3]) > 0.5


@pytest.mark.parametrize("frame", ["tip", "box"])
def test_in_a_body_s_frame_everything_is_seen_from_its_pose_of_the_same_instant(frame):
    world = scene()
    publisher(world, frame_id=frame)
    world.loop.step(300)
    origin, axes = by_mujoco(world, frame)[0], matrix(by_mujoco(world, frame)[1])
    for state in messages(world)[-1].free_joints:
        position, quat, linear, angular = by_mujoco(world, state.name)
        got = numbers(state)
        assert np.abs(got[0] - axes.T @ (position - origin)).max() < 1e-12
        assert np.abs(matrix(got[1]) - axes.T @ matrix(quat)).max() < 1e-12
        assert np.abs(got[2] - axes.T @ linear).max() < 1e-12
        assert np.abs(got[3] - axes.T @ angular).max() < 1e-12


def test_a_stale_reference_pose_would_be_noticed():
    """Guards the test above: one step earlier, the frame was somewhere else."""
    world = scene()
    world.loop.step(300)
    stale = world.data.body("tip").xpos.copy()
    assert np.abs(by_mujoco(world, "tip")[0] - stale).max() > 1e-4


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 0.01)
three = st.tuples(*[st.floats(-10, 10)] * 3)
state_of_body = st.tuples(three, unit, three, three)


@settings(deadline=None)
@given(
    states=st.tuples(state_of_body, state_of_body),
    frame=st.sampled_from(["", "world", "tip", "box"]),
    seed=st.integers(0, 9),
)
def test_a_message_given_back_to_the_service_brings_the_state_back(states, frame, seed):
    # Bodies may overlap here.
    world = scene(SCENE.replace('timestep="0.002"/>', 'timestep="0.002"><flag contact="disable"/></option>'), seed)
    publisher(world, frame_id=frame)
    world.loop.step(5)
    for index, (position, quat, linear, angular) in enumerate(states):
        q, v = int(world.model.jnt_qposadr[2 + index]), int(world.model.jnt_dofadr[2 + index])
        world.data.qpos[q : q + 7] = (*position, *np.divide(quat, np.linalg.norm(quat)))
        world.data.qvel[v : v + 6] = (*linear, *angular)
    world.loop.step(1)
    qpos, qvel = world.data.qpos.copy(), world.data.qvel.copy()
    message = messages(world)[-1]
    # A body that is the frame of the message must not have moved; the others may be anywhere.
    for body, joint in (("box", 2), ("ball", 3), ("brick", 4)):
        if body != frame:
            q, v = int(world.model.jnt_qposadr[joint]), int(world.model.jnt_dofadr[joint])
            world.data.qpos[q : q + 7] = (1, 2, 3, 0, 1, 0, 0)
            world.data.qvel[v : v + 6] = 7.0
    world.simulation.forward()
    call = world.call(SERVICE, SetFreeJointState.Request(free_joints=message.free_joints))
    assert call.response.message == "set the state of 3 bodies"
    assert np.abs(world.data.qpos - qpos).max() < 1e-12
    assert np.abs(world.data.qvel - qvel).max() < 1e-12


def test_every_header_has_the_frame_and_the_time_of_the_state():
    world = scene()
    publisher(world, frame_id="tip", publish_rate=100.0)
    world.loop.step(20)
    stamps = []
    for message in messages(world):
        headers = [message.header]
        headers += [header for s in message.free_joints for header in (s.pose.header, s.twist.header)]
        assert {header.frame_id for header in headers} == {"tip"}
        (stamp,) = {header.stamp.to_ns() for header in headers}
        stamps.append(stamp)
    assert stamps == [10_000_000, 20_000_000, 30_000_000, 40_000_000]


@pytest.mark.parametrize("frame", ["", "world"])
def test_the_world_can_be_named_or_left_empty(frame):
    world = scene()
    publisher(world, frame_id=frame)
    world.loop.step(1)
    (message,) = messages(world)
    assert {s.pose.header.frame_id for s in message.free_joints} == {frame}
    assert np.abs(numbers(message.free_joints[0])[0] - by_mujoco(world, "box")[0]).max() < 1e-12


def test_an_unknown_frame_is_said_and_the_world_takes_its_place(caplog):
    world = scene()
    publisher(world, frame_id="tipp")
    assert [(r.levelname, r.getMessage()) for r in caplog.records] == [
        (
            "ERROR",
            "frame_id: unknown body 'tipp', did you mean 'tip'?; known: ball, box, brick, swing, tip, world; "
            "the world frame is used instead",
        )
    ]
    world.loop.step(1)
    (message,) = messages(world)
    assert {message.header.frame_id, *(s.pose.header.frame_id for s in message.free_joints)} == {""}
    assert np.abs(numbers(message.free_joints[0])[0] - by_mujoco(world, "box")[0]).max() < 1e-12


def test_chosen_bodies_come_in_the_order_of_the_list():
    world = scene()
    publisher(world, body_names=["brick", "box"])
    world.loop.step(10)
    states = messages(world)[-1].free_joints
    assert [state.name for state in states] == ["brick", "box"]
    for state in states:
        assert np.abs(numbers(state)[3] - by_mujoco(world, state.name)[3]).max() < 1e-12


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (["box", "bal"], "unknown body with a free joint 'bal', did you mean 'ball'?; known: ball, box, brick"),
        ([""], "unknown body with a free joint ''; known: ball, box, brick"),
        (["swing"], "body 'swing' has no free joint; bodies with a free joint: ball, box, brick"),
        (["world"], "body 'world' has no free joint; bodies with a free joint: ball, box, brick"),
    ],
)
def test_bodies_without_a_free_joint_are_refused_with_those_that_have_one(names, reason):
    with pytest.raises(MjplugError) as caught:
        publisher(scene(), body_names=names)
    assert str(caught.value) == reason


def test_unnamed_bodies_are_left_out_and_reported(caplog):
    world = scene(SCENE.replace('name="ball"', ""))
    publisher(world)
    world.loop.step(1)
    assert [state.name for state in messages(world)[-1].free_joints] == ["box", "brick"]
    assert [r.getMessage() for r in caplog.records] == [
        "not published, because they have no name: 1 of the bodies with a free joint"
    ]


def test_a_model_without_free_bodies_publishes_empty_messages_and_reports_it(caplog):
    world = scene("<mujoco><worldbody><body name='a'><joint/><geom size='1'/></body></worldbody></mujoco>")
    publisher(world, frame_id="a")
    world.loop.step(1)
    (message,) = messages(world)
    assert message.free_joints == ()
    assert message.header.frame_id == "a"
    assert [r.getMessage() for r in caplog.records] == [
        "the model has no body with a free joint: the messages are empty"
    ]


def test_the_rate_is_that_of_simulated_time_and_a_reset_restarts_its_phase():
    world = scene()
    publisher(world, publish_rate=50)
    world.loop.step(15)
    world.loop.reset(Reset())
    world.loop.step(25)
    assert [m.header.stamp.to_ns() for m in messages(world)] == [20_000_000, 50_000_000, 70_000_000]


def test_a_rate_that_does_not_divide_the_step_rate_has_an_exact_mean():
    world = scene()
    publisher(world, publish_rate=70)
    world.loop.step(5000)
    assert len(messages(world)) == 700
    assert [m.header.stamp.to_ns() for m in messages(world)][-70::69] == [9_016_000_000, 10_000_000_000]


def test_nothing_is_computed_without_subscribers():
    world = scene()
    publisher(world)
    world.transport.publishers[TOPIC].matched = False
    world.loop.step(100)
    assert messages(world) == []
    assert world.loop.scheduler.next_due > 1_000_000


def test_a_driven_base_shows_its_real_velocity():
    world = scene()
    publisher(world, body_names=["brick"])
    world.add(BaseVelocity, "drive", body="brick", cmd_timeout=10)
    world.transport.send("/drive/cmd_vel", Twist(linear=Vector3(x=0.25), angular=Vector3(z=0.5)))
    world.loop.step(50)
    _, _, linear, angular = numbers(messages(world)[-1].free_joints[0])
    assert np.linalg.norm(linear[:2]) == pytest.approx(0.25, abs=0.01)
    assert np.isfinite(angular).all()
    assert np.abs(linear - by_mujoco(world, "brick")[2]).max() < 1e-12


def test_watching_does_not_change_what_happens():
    alone, watched = scene(), scene()
    publisher(watched, frame_id="tip")
    alone.loop.step(1000)
    watched.loop.step(1000)
    assert np.array_equal(alone.data.qpos, watched.data.qpos)
    assert len(messages(watched)) == 1000


@pytest.mark.parametrize("rate", [0, -1.0, float("nan"), float("inf"), "50", True])
def test_a_rate_that_is_no_positive_number_is_refused(rate):
    with pytest.raises(ValidationError):
        FreeJointStatePublisherParameters(publish_rate=rate)


def selected_of(tmp_path, text):
    (tmp_path / "plugins.yaml").write_text(text)
    _, (selected,) = select(read(tmp_path / "plugins.yaml", model="bundled:arm"))
    return selected


def test_the_documented_configuration_loads_unchanged(tmp_path):
    selected = selected_of(tmp_path, DOCUMENTED)
    assert selected.plugin_class is FreeJointStatePublisher
    assert selected.name == "free_joint_state_publisher"
    assert selected.parameters == FreeJointStatePublisherParameters()


def test_a_body_that_is_listed_twice_is_refused_in_its_place(tmp_path):
    with pytest.raises(ConfigError) as caught:
        selected_of(tmp_path, DOCUMENTED.replace("[]", "[cube1, cube2, cube1]"))
    (problem,) = caught.value.problems
    assert problem.message == (
        "plugins.free_joint_state_publisher.body_names: list each body once; listed twice: 'cube1'"
    )
    assert problem.mark.line == 7
