"""Entities of the standard interface: names, filters, states, descriptions, bounds and named poses."""

import json
import math
import re

import mujoco
import numpy as np
import pytest
from standard_worlds import SCENE, StandardWorld

from mjplug.errors import RequestError
from mjplug.services.standard import regex
from mjplug_schemas.simulation_interfaces import Bounds, EntityCategory

POSE = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 2.0, "w": 2.0}}
ALL = ["arm", "ball", "body_7", "cup", "marker", "sheet", "wall"]


@pytest.fixture
def world():
    return StandardWorld()


def names(world, **filters):
    response = world.ask("GetEntities", filters=filters)
    assert response.result.result == 1, response.result.error_message
    return list(response.entities)


def test_the_children_of_the_world_are_the_entities_sorted_by_name(world):
    assert names(world) == ALL


@pytest.mark.parametrize(
    ("pattern", "found"),
    [
        ("a", ["arm", "ball", "marker", "wall"]),
        ("^a", ["arm"]),
        ("l$", ["ball", "wall"]),
        ("^(cup|ball)$", ["ball", "cup"]),
        ("[[:digit:]]", ["body_7"]),
        ("a{1,3}ll", ["ball", "wall"]),
        ("nothing", []),
    ],
)
def test_a_regular_expression_is_searched_in_the_name(world, pattern, found):
    assert names(world, filter=pattern) == found


@pytest.mark.parametrize(
    ("pattern", "reason"),
    [
        ("(", "not a POSIX extended regular expression"),
        (r"(a)\1", "back-reference"),
        ("a" * 1001, "1001 bytes"),
        ("((a{1,200}){1,200}){1,200}", "repeats up to"),
        ("a{99999}", "repeats too often"),
    ],
)
def test_a_filter_that_is_wrong_or_costly_is_refused(world, pattern, reason):
    code, text = world.code("GetEntities", filters={"filter": pattern})
    assert (code, reason in text) == (4, True), text


def test_a_pattern_that_takes_pythons_re_seconds_is_searched_at_once():
    assert regex.search("(a+)+$")("a" * 60 + "b") is False
    assert regex.search("(a+)+$")("b" + "a" * 60) is True


@pytest.mark.parametrize("pattern", ["(a+)+$", "(a|aa)*b", "((a)*)*", "(a{2,3}){4}"])
def test_without_a_c_library_such_a_pattern_is_refused(monkeypatch, pattern):
    monkeypatch.setattr(regex, "_LIBRARY", None)
    with pytest.raises(RequestError, match="repeats a group"):
        regex.search(pattern)


def test_without_a_c_library_classes_are_translated(monkeypatch):
    monkeypatch.setattr(regex, "_LIBRARY", None)
    search = regex.search("^[[:alpha:]_]+[[:digit:]]{1,2}$")
    assert search("body_7")
    assert not search("body_")
    with pytest.raises(RequestError, match="not valid"):
        regex.search("(")


def test_categories_follow_from_joints_and_actuators(world):
    def of(category):
        return names(world, categories=[{"category": category}])

    assert of(EntityCategory.CATEGORY_ROBOT) == ["arm"]
    assert of(EntityCategory.CATEGORY_DYNAMIC_OBJECT) == ["ball", "cup"]
    assert of(EntityCategory.CATEGORY_STATIC_OBJECT) == ["body_7", "marker", "sheet", "wall"]
    assert names(world, categories=[{"category": 1}, {"category": 4}]) == ["arm", "ball", "cup"]


def test_descriptions_are_configured_set_and_forgotten_by_a_complete_reset():
    world = StandardWorld(
        entities={"mug": {"body": "cup", "category": "human", "tags": ["red"], "description": "d"}, "ball": {}}
    )
    assert "mug" in names(world)
    assert "cup" not in names(world)
    info = world.ask("GetEntityInfo", entity="mug").info
    assert (info.category.category, info.tags, info.description) == (2, ("red",), "d")
    changed = {"category": {"category": 1}, "tags": ["blue", "red"], "description": "e"}
    assert world.code("SetEntityInfo", entity="mug", info=changed)[0] == 1
    assert world.ask("GetEntityInfo", entity="mug").info.tags == ("blue", "red")
    assert names(world, tags={"tags": ["red", "green"]}) == ["mug"]
    assert names(world, tags={"tags": ["red", "green"], "filter_mode": 1}) == []
    assert names(world, tags={"tags": ["red", "blue"], "filter_mode": 1}) == ["mug"]
    assert world.code("GetEntities", filters={"tags": {"filter_mode": 2}})[0] == 4
    world.ask("ResetSimulation", scope=2)
    assert world.ask("GetEntityInfo", entity="mug").info.tags == ("blue", "red")
    world.ask("ResetSimulation", scope=255)
    assert world.ask("GetEntityInfo", entity="mug").info == info


def test_an_unknown_category_is_refused(world):
    assert world.code("SetEntityInfo", entity="cup", info={"category": {"category": 3}})[0] == 4


@pytest.mark.parametrize(
    "service", ["GetEntityInfo", "GetEntityState", "GetEntityBounds", "SetEntityInfo", "SetEntityState"]
)
@pytest.mark.parametrize("name", ["cupp", "", "world", "../cup", "cup\n", "hand"])
def test_an_unknown_entity_is_not_found(world, service, name):
    code, text = world.code(service, entity=name)
    assert code == 2
    assert "known: arm, ball" in text


def test_an_unnamed_body_says_that_its_name_is_not_stable(world):
    assert "has no name" in world.ask("GetEntityInfo", entity="body_7").info.description


def test_poses_and_velocities_are_in_the_world_frame(world):
    data, model = world.data, world.model
    world.step(100)
    data.qvel[:6] = [1, 2, 3, 0.1, 0.2, 0.3]
    data.qvel[model.joint("shoulder").dofadr[0]] = 0.5
    expected = mujoco.MjData(model)
    expected.qpos[:], expected.qvel[:], expected.ctrl[:] = data.qpos, data.qvel, data.ctrl
    mujoco.mj_forward(model, expected)
    world.loop.step(0)
    world.simulation.mark_poses_outdated()
    response = world.ask("GetEntitiesStates", filters={"filter": "^(arm|cup|marker)$"})
    assert response.entities == ("arm", "cup", "marker")
    for name, state in zip(response.entities, response.states, strict=True):
        body, twist = model.body(name).id, np.zeros(6)
        mujoco.mj_objectVelocity(model, expected, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
        got = [getattr(state.twist.angular, a) for a in "xyz"] + [getattr(state.twist.linear, a) for a in "xyz"]
        assert got == pytest.approx(twist.tolist(), abs=1e-12)
        position, turn = state.pose.position, state.pose.orientation
        assert [position.x, position.y, position.z] == pytest.approx(expected.xpos[body].tolist())
        assert [turn.w, turn.x, turn.y, turn.z] == pytest.approx(expected.xquat[body].tolist())
        assert state.header.frame_id == "world"
        assert (state.header.stamp.sec, state.header.stamp.nanosec) == (0, 200_000_000)


def test_a_body_at_rest_has_no_acceleration_and_a_falling_one_that_of_gravity():
    world = StandardWorld()
    world.step(3)
    falling = world.ask("GetEntityState", entity="cup").state.acceleration.linear
    assert (falling.x, falling.y, falling.z) == pytest.approx((0, 0, -9.81))
    world.step(3000)
    resting = world.ask("GetEntityState", entity="ball").state.acceleration.linear
    assert (resting.x, resting.y, resting.z) == pytest.approx((0, 0, 0), abs=1e-2)
    static = world.ask("GetEntityState", entity="wall").state.acceleration.linear
    assert (static.x, static.y, static.z) == (0, 0, 0)


def test_a_long_list_of_states_is_of_one_time():
    bodies = "".join(f"<body name='b{i:02}' pos='{i} 0 9'><freejoint/><geom size='.1'/></body>" for i in range(45))
    world = StandardWorld(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>", paused=False)
    world.step(20)
    call = world.send("GetEntitiesStates")
    heights = world.data.xpos[1:, 2].copy()
    while not call.answered:
        world.loop.turn()
    assert world.simulation.step > 20
    assert [state.pose.position.x for state in call.response.states] == list(range(45))
    assert [state.pose.position.z for state in call.response.states] == heights.tolist()
    assert {state.header.stamp.nanosec for state in call.response.states} == {40_000_000}


def test_reading_states_does_not_change_the_next_steps():
    first, second = StandardWorld(), StandardWorld()
    for _ in range(50):
        first.step(7)
        second.step(7)
        second.ask("GetEntitiesStates")
        second.ask("GetEntityBounds", entity="arm")
        second.ask("GetEntities", filters={"bounds": box((-5, -5, -5), (5, 5, 5))})
    assert first.data.qpos.tobytes() == second.data.qpos.tobytes()
    assert first.data.qvel.tobytes() == second.data.qvel.tobytes()


def test_a_pose_is_set_normalized_and_a_velocity_turned_into_body_axes(world):
    twist = {"linear": {"x": 1.0}, "angular": {"x": 2.0}}
    state = {"pose": POSE, "twist": twist}
    assert world.code("SetEntityState", entity="cup", state=state, set_pose=True, set_twist=True) == (1, "")
    assert world.data.qpos[:3].tolist() == [1, 2, 3]
    half = math.sqrt(0.5)
    assert world.data.qpos[3:7].tolist() == pytest.approx([half, 0, 0, half])
    assert world.data.qvel[:3].tolist() == [1, 0, 0]
    assert world.data.qvel[3:6].tolist() == pytest.approx([0, -2, 0])
    got = world.ask("GetEntityState", entity="cup").state
    assert (got.twist.angular.x, got.twist.angular.y) == pytest.approx((2, 0))


def test_only_what_the_flags_say_is_set(world):
    before = world.data.qpos.copy(), world.data.qvel.copy()
    code, text = world.code("SetEntityState", entity="cup", state={"pose": POSE})
    assert (code, "nothing was set" in text) == (1, True)
    assert world.data.qpos.tolist() == before[0].tolist()
    twist = {"linear": {"z": 4.0}}
    world.code("SetEntityState", entity="cup", state={"pose": POSE, "twist": twist}, set_twist=True)
    assert world.data.qpos.tolist() == before[0].tolist()
    assert world.data.qvel[2] == 4.0
    code, text = world.code("SetEntityState", entity="cup", state={"pose": POSE}, set_pose=True, set_acceleration=True)
    assert (code, "accelerations are not set" in text) == (1, True)
    assert world.data.qvel[2] == 4.0


def test_a_pose_in_the_frame_of_an_entity_or_body_is_composed(world):
    world.code("SetEntityState", entity="ball", state={"pose": POSE}, set_pose=True)
    state = {"header": {"frame_id": "ball"}, "pose": {"position": {"x": 1.0}, "orientation": {"w": 1.0}}}
    assert world.code("SetEntityState", entity="cup", state=state, set_pose=True)[0] == 1
    assert world.data.qpos[:3].tolist() == pytest.approx([1, 3, 3])
    state["header"] = {"frame_id": "hand"}
    assert world.code("SetEntityState", entity="cup", state=state, set_pose=True)[0] == 1
    assert world.data.qpos[:3].tolist() == pytest.approx([2, 1, 0])
    state["header"] = {"frame_id": "camera"}
    assert world.code("SetEntityState", entity="cup", state=state, set_pose=True)[0] == 0


def test_a_mocap_body_gets_a_pose_and_a_fixed_one_refuses_it(world):
    assert world.code("SetEntityState", entity="marker", state={"pose": POSE}, set_pose=True)[0] == 1
    assert world.data.mocap_pos[0].tolist() == [1, 2, 3]
    moving = {"twist": {"linear": {"x": 1.0}}}
    for name in ("marker", "wall", "arm"):
        assert world.code("SetEntityState", entity=name, state=moving, set_twist=True)[0] == 4
        assert world.code("SetEntityState", entity=name, set_twist=True)[0] == 1
    for name in ("wall", "arm"):
        code, text = world.code("SetEntityState", entity=name, state={"pose": POSE}, set_pose=True)
        assert (code, "cannot be set" in text) == (4, True)


@pytest.mark.parametrize(
    ("part", "value"),
    [("position", {"x": math.nan}), ("position", {"y": math.inf}), ("position", {"z": 1e10}),
     ("orientation", {"w": 0.0}), ("orientation", {"x": math.nan})],
)  # fmt: skip
def test_an_invalid_pose_has_its_own_code_and_changes_nothing(world, part, value):
    before = world.data.qpos.copy()
    pose = {"orientation": {"w": 1.0}} | {part: value}
    assert world.code("SetEntityState", entity="cup", state={"pose": pose}, set_pose=True)[0] == 101
    twist = {"linear": {"x": math.nan}}
    assert world.code("SetEntityState", entity="cup", state={"twist": twist}, set_twist=True)[0] == 4
    assert world.data.qpos.tolist() == before.tolist()


def box(low, high):
    points = [dict(zip("xyz", map(float, point), strict=True)) for point in (high, low)]
    return {"type": Bounds.TYPE_BOX, "points": points}


def sphere(centre, radius):
    points = [dict(zip("xyz", map(float, centre), strict=True)), {"x": float(radius)}]
    return {"type": Bounds.TYPE_SPHERE, "points": points}


def corners(bounds):
    assert bounds.type == Bounds.TYPE_BOX
    high, low = ([point.x, point.y, point.z] for point in bounds.points)
    return high, low


def test_bounds_are_a_box_in_the_frame_of_the_canonical_link(world):
    high, low = corners(world.ask("GetEntityBounds", entity="cup").bounds)
    assert high == pytest.approx([0.15, 0.2, 0.3])
    assert low == pytest.approx([-0.05, -0.2, -0.3])
    world.code("SetEntityState", entity="cup", state={"pose": POSE}, set_pose=True)
    assert corners(world.ask("GetEntityBounds", entity="cup").bounds)[0] == pytest.approx([0.15, 0.2, 0.3])
    high, low = corners(world.ask("GetEntityBounds", entity="arm").bounds)
    assert high == pytest.approx([1.1, 0.1, 0.1])
    assert low == pytest.approx([-0.05, -0.1, -0.1])
    assert world.ask("GetEntityBounds", entity="sheet").bounds.type == Bounds.TYPE_EMPTY


def test_entities_are_found_by_a_box_and_a_sphere(world):
    assert names(world, bounds=box((0.4, -1, 0), (0.6, 1, 2))) == ["arm", "cup"]
    assert names(world, bounds=box((0.6, 1, 2), (0.4, -1, 0))) == ["arm", "cup"]
    assert names(world, bounds=sphere((-1, 0, 1.2), 0.11)) == ["ball"]
    assert names(world, bounds=sphere((-1, 0, 1.2), 0.09)) == []
    assert names(world, bounds=sphere((0, 0, -1), 0.0)) == ["sheet"]


@pytest.mark.parametrize(
    ("bounds", "code"),
    [
        ({"type": Bounds.TYPE_CONVEX_HULL}, 0),
        ({"type": 9}, 4),
        ({"type": Bounds.TYPE_BOX}, 4),
        (box((0, 0, math.nan), (1, 1, 1)), 4),
        (sphere((0, 0, 0), -1), 4),
        (sphere((0, 0, 0), math.nan), 4),
    ],
)
def test_a_volume_that_is_not_supported_or_not_valid_is_refused(world, bounds, code):
    assert world.code("GetEntities", filters={"bounds": bounds})[0] == code


def test_named_poses_are_fixed_or_follow_a_site():
    world = StandardWorld(
        named_poses={
            "dock": {
                "position": [1, 2, 3],
                "orientation": [0, 0, 1, 1],
                "tags": ["parking"],
                "bounds": {"sphere": 0.5},
            },
            "tip": {"site": "tip", "bounds": {"box": [[-1, -2, -3], [1, 2, 3]]}},
            "gone": {"site": "no such site"},
        }
    )
    poses = world.ask("GetNamedPoses").poses
    assert [pose.name for pose in poses] == ["dock", "tip"]
    half = math.sqrt(0.5)
    assert (poses[0].pose.orientation.z, poses[0].pose.orientation.w) == pytest.approx((half, half))
    tip = poses[1].pose.position
    assert (tip.x, tip.y, tip.z) == pytest.approx((1, 1, 0.1))
    world.data.qpos[world.model.joint("shoulder").qposadr[0]] = math.pi / 2
    world.simulation.mark_poses_outdated()
    moved = world.ask("GetNamedPoses").poses[1].pose.position
    assert (moved.x, moved.y) == pytest.approx((0, 2))
    assert [pose.name for pose in world.ask("GetNamedPoses", tags={"tags": ["parking"]}).poses] == ["dock"]
    assert world.ask("GetNamedPoseBounds", name="dock").bounds.points[1].x == 0.5
    assert corners(world.ask("GetNamedPoseBounds", name="tip").bounds) == ([1, 2, 3], [-1, -2, -3])
    assert world.code("GetNamedPoseBounds", name="tap")[0] == 2


def test_the_features_name_what_is_supported_and_the_rest_answers_so(world):
    response = world.ask("GetSimulatorFeatures")
    features = set(response.features.features)
    assert {2, 3, 4, 5, 6, 8, 10, 11, 12, 13, 20, 21, 22, 24, 25, 26, 31, 32, 44} <= features
    assert 7 not in features
    assert "convex" in response.features.custom_info


def test_all_22_services_exist(world):
    services = {name for name in world.transport.services if not ("/_action/" in name or name.startswith("/mjplug/"))}
    assert len(services) == 22
    assert all(re.fullmatch("/[a-z_]+", name) for name in services)


def test_json_requests_use_the_defaults_of_the_standard():
    world = StandardWorld(SCENE)
    kind = world.transport.types["/step_simulation"]
    request = kind.Request.from_json(json.dumps({}))
    assert request.steps == 1
