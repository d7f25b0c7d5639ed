"""Values of the model that clients change while the simulation runs."""

import mujoco
import pytest
from standard_worlds import DOOR, SCENE, StandardWorld

from mjplug_schemas.mjplug_msgs import ModelValue, SetModelValues

NAMED = SCENE.replace('<geom type="box" size=".1 .2 .3" pos=".05 0 0" mass="1"/>',
                      '<geom name="cup" type="box" size=".1 .2 .3" mass="1"/>')  # fmt: skip


@pytest.fixture
def world():
    return StandardWorld(NAMED)


def put(world, *values):
    """Sets values, given as (element, attribute, values); returns the refusal, None if there is none."""
    sent = [ModelValue(element=element, attribute=attribute, values=numbers) for element, attribute, numbers in values]
    call = world.call("/mjplug/set_model_values", SetModelValues.Request(values=sent))
    while not call.answered:
        world.loop.turn()
    return call.refusal


@pytest.mark.parametrize(
    ("element", "attribute", "values", "read"),
    [
        ("option", "gravity", [0, 0, -1.6], lambda m: m.opt.gravity.tolist()),
        ("geom/floor", "friction", [0.3, 0.01, 0.002], lambda m: m.geom("floor").friction.tolist()),
        ("geom/cup", "mass", [2.5], lambda m: m.body("cup").mass.tolist()),
        ("geom/cup", "size", [0.2, 0.2, 0.2], lambda m: m.geom("cup").size.tolist()),
        ("geom/floor", "rgba", [1, 0, 0, 1], lambda m: m.geom("floor").rgba.tolist()),
        ("joint/shoulder", "damping", [3.0], lambda m: m.dof_damping[[m.joint("shoulder").dofadr[0]]].tolist()),
        ("actuator/shoulder", "kv", [7.0], lambda m: [m.actuator("shoulder").gainprm[0]]),
    ],
)
def test_a_value_takes_effect_and_the_state_continues(world, element, attribute, values, read):
    world.step(50)
    before = world.data.qpos.copy()
    assert put(world, (element, attribute, values)) is None
    assert read(world.model) == pytest.approx(values)
    assert world.data.qpos.tolist() == before.tolist()
    assert world.simulation.step == 50


def test_a_larger_geom_has_a_larger_box_and_inertia(world):
    inertia = world.model.body("cup").inertia.copy()
    put(world, ("geom/cup", "size", [0.2, 0.4, 0.6]))
    assert world.ask("GetEntityBounds", entity="cup").bounds.points[0].z == pytest.approx(0.6)
    assert world.model.body("cup").inertia.tolist() == pytest.approx((4 * inertia).tolist())


def test_gravity_acts_from_the_next_step_on(world):
    put(world, ("option", "gravity", [0, 0, 0]))
    world.step(100)
    assert world.data.body("ball").xpos[2] == 1.0


def test_values_stay_when_entities_come_and_go_and_end_with_a_complete_reset(world):
    put(world, ("geom/floor", "friction", [0.3]))
    world.spawn("door", DOOR)
    put(world, ("geom/door/post", "rgba", [0, 1, 0, 1]))
    assert world.model.geom("floor").friction[0] == 0.3
    assert world.model.geom("door/post").rgba.tolist() == [0, 1, 0, 1]
    world.ask("DeleteEntity", entity="door")
    assert world.model.geom("floor").friction[0] == 0.3
    world.ask("ResetSimulation", scope=2)
    world.ask("ResetSimulation", scope=4)
    assert world.model.geom("floor").friction[0] == 0.3
    world.ask("ResetSimulation", scope=255)
    assert world.model.geom("floor").friction[0] == 1.0


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (("geom/nothing", "friction", [1]), "unknown geom 'nothing'"),
        (("geom/", "friction", [1]), "kind and name"),
        (("option/x", "gravity", [0, 0, 0]), "kind and name"),
        (("camera/eye", "fovy", [1]), "unknown kind of element 'camera'"),
        (("geom/floor", "contype", [1]), "unknown attribute of geom 'contype'"),
        (("geom/floor", "rgba", [1, 0]), "rgba has 2 values; it needs 4"),
        (("geom/floor", "friction", []), "friction has 0 values"),
        (("geom/floor", "friction", [float("nan")]), "must be finite"),
        (("geom/cup", "size", [-1.0, 1, 1]), "size"),
        (("geom/cup", "mass", [-1.0]), "mass"),
        (("body/cup", "mass", [2.0]), "follows from its geoms"),
        (("actuator/shoulder", "kp", [2.0]), "is no position servo"),
    ],
)
def test_one_invalid_value_refuses_all(world, value, reason):
    model = world.model
    refusal = put(world, ("option", "gravity", [0, 0, -1]), value)
    assert refusal is not None
    assert reason in refusal
    assert "nothing was changed" in refusal
    assert world.model is model
    assert put(world, ("option", "gravity", [0, 0, -1])) is None


def test_bodies_with_their_own_inertia_get_a_mass():
    body = "<body name='b'><freejoint/><inertial pos='0 0 0' mass='2' diaginertia='1 2 3'/></body>"
    scene = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    world = StandardWorld(scene)
    assert put(world, ("body/b", "mass", [4.0])) is None
    assert world.model.body("b").mass.tolist() == [4.0]
    assert sorted(world.model.body("b").inertia.tolist()) == pytest.approx([2, 4, 6])
    assert isinstance(world.model, mujoco.MjModel)
