import mujoco
import numpy as np
import pytest
from joint_robots import MIXED, compiled
from pydantic import ValidationError

from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.plugin import QoS
from mjplug.testing import World
from mjplug_plugins.joints import JointStatePublisher

TOPIC = "/joint_states"
SCALARS = ["rail", "shoulder", "elbow", "wrist", "loose"]


def world_of(xml=MIXED, **parameters):
    world = World(compiled(xml))
    world.add(JointStatePublisher, "states", **{"rate": 500.0, **parameters})
    return world


def driven(world):
    """Lets everything move by controls that change at every step."""
    random = np.random.default_rng(0)
    for _ in range(100):
        world.data.ctrl[:] = random.normal(size=world.model.nu)
        world.loop.step(1)
    return world.published(TOPIC)[-1]


def test_positions_and_velocities_are_those_of_the_stamp_and_efforts_those_of_the_step_that_led_there():
    world = world_of()
    random = np.random.default_rng(0)
    model, data = compiled(MIXED), mujoco.MjData(compiled(MIXED))
    for _ in range(100):
        world.data.ctrl[:] = data.ctrl[:] = random.normal(size=model.nu)
        world.loop.step(1)
        mujoco.mj_step(model, data)
    message = world.published(TOPIC)[-1]
    assert list(message.name) == SCALARS
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == 200_000_000
    dofs = [model.joint(name).dofadr[0] for name in SCALARS]
    places = [model.joint(name).qposadr[0] for name in SCALARS]
    assert message.position == tuple(data.qpos[places])
    assert message.velocity == tuple(data.qvel[dofs])
    # What the controls of that very step exerted: a gear of 4, and nothing at the joint that has no actuator.
    assert message.effort == tuple(data.qfrc_actuator[dofs])
    assert message.effort[2] == pytest.approx(4 * np.clip(data.ctrl[2], -5, 5))
    assert message.effort[4] == 0.0


@pytest.mark.parametrize("joints", [["elbow", "rail"], ["shoulder", "elbow", "wrist"], ["wrist"]])
def test_chosen_joints_come_in_their_order(joints):
    world = world_of(joints=joints)
    message = driven(world)
    assert list(message.name) == joints
    assert message.position == tuple(float(world.data.joint(name).qpos[0]) for name in joints)
    assert message.velocity == tuple(float(world.data.joint(name).qvel[0]) for name in joints)


@pytest.mark.parametrize("interfaces", [["position"], ["velocity", "position"], ["effort"], []])
def test_only_the_interfaces_that_are_asked_for_are_there_each_for_every_name(interfaces):
    message = driven(world_of(interfaces=interfaces))
    for interface in ("position", "velocity", "effort"):
        assert len(getattr(message, interface)) == (len(SCALARS) if interface in interfaces else 0)


def test_in_the_order_of_actuators_those_that_have_one_come_first_each_once():
    swapped = MIXED.replace('<velocity name="rail_drive"', '<motor joint="wrist" gear="2"/><velocity name="rail_drive"')
    assert list(driven(world_of(swapped, order="actuators")).name) == ["wrist", "rail", "shoulder", "elbow", "loose"]


def test_an_actuator_at_a_tendon_stands_for_the_joint_of_its_name():
    world = World(load_model("bundled:arm").model)
    world.add(JointStatePublisher, "states", order="actuators")
    world.loop.step(10)
    assert list(world.published(TOPIC)[-1].name) == [
        "joint1", "joint2", "gripper_left_finger_joint", "gripper_right_finger_joint",
    ]  # fmt: skip


def test_messages_come_at_the_rate_in_simulated_time_and_right_after_a_reset_too():
    world = world_of(rate=100.0)
    world.loop.step(500)
    world.loop.reset(Reset())
    world.loop.step(5)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in world.published(TOPIC)]
    assert stamps == [k * 10_000_000 for k in range(1, 102)]
    assert world.published(TOPIC)[-1].position == pytest.approx((0.0,) * 5, abs=1e-3)


def test_its_quality_of_service_suits_best_effort_and_reliable_subscriptions_alike():
    assert world_of().transport.qos[TOPIC] == QoS(depth=10, reliability="reliable", durability="volatile")


def test_nothing_is_built_without_subscribers():
    world = world_of()
    world.transport.publishers[TOPIC].matched = False
    world.loop.step(100)
    assert not world.published(TOPIC)
    assert world.loop.scheduler.next_due > world.simulation.step + 100


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"joints": ["elbw"]}, "unknown joint 'elbw', did you mean 'elbow'"),
        ({"joints": ["socket"]}, "joint 'socket' is neither a hinge nor a slide"),
    ],
)
def test_a_wrong_joint_stops_the_start(parameters, sentence):
    with pytest.raises(MjplugError, match=sentence):
        world_of(**parameters)


@pytest.mark.parametrize("wrong", [{"interfaces": ["torque"]}, {"rate": 0.0}, {"joints": ["a", "a"]}, {"order": "id"}])
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ValidationError):
        JointStatePublisher.parameters_type(**wrong)
