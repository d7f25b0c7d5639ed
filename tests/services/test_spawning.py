"""Adding and removing entities while the simulation runs."""

import threading

import mujoco
import numpy as np
import pytest
from standard_worlds import CUP, DOOR, SCENE, StandardWorld

from mjplug.model import recipe as recipes
from mjplug.physics.reset import Reset

MANY = "<mujoco><worldbody><replicate count='100000000'><geom size='1'/></replicate></worldbody></mujoco>"
HUGE = "<mujoco><asset><texture width='90000' height='90000' builtin='flat' type='2d'/></asset></mujoco>"
POSE = {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"w": 1.0}}}


@pytest.fixture
def world():
    return StandardWorld()


def names(world):
    return list(world.ask("GetEntities").entities)


def state_of(world):
    """The state of the present model by the names of joints and actuators."""
    model, data = world.model, world.data
    joints = {}
    for joint in range(model.njnt):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) or f"of body {model.jnt_bodyid[joint]}"
        dofs = {0: 6, 1: 3, 2: 1, 3: 1}[int(model.jnt_type[joint])]
        begin, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        qpos = data.qpos[begin : begin + dofs + (dofs > 1)].tolist()
        joints[name] = qpos, data.qvel[dof : dof + dofs].tolist(), data.qacc_warmstart[dof : dof + dofs].tolist()
    return joints, dict(zip(map(str, range(model.nu)), data.ctrl.tolist(), strict=True)), data.mocap_pos.tolist()


def test_a_free_body_appears_at_its_pose_and_falls(world):
    response = world.spawn("mug", initial_pose=POSE)
    assert response.result.result == 1, response.result.error_message
    assert response.entity_name == "mug"
    assert "mug" in names(world)
    pose = world.ask("GetEntityState", entity="mug").state.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (1, 2, 3)
    world.step(100)
    assert world.ask("GetEntityState", entity="mug").state.pose.position.z < 3
    assert world.ask("GetEntityInfo", entity="mug").info.category.category == 4


def test_a_fixed_model_is_a_mocap_body_that_can_be_moved_with_its_joints(world):
    assert world.spawn("door", DOOR, initial_pose=POSE).result.result == 1
    assert world.ask("GetEntityInfo", entity="door").info.category.category == 1
    pose = world.ask("GetEntityState", entity="door").state.pose.position
    assert (pose.x, pose.y, pose.z) == (1, 2, 3)
    moved = {"pose": {"position": {"x": 5.0}, "orientation": {"w": 1.0}}}
    assert world.code("SetEntityState", entity="door", state=moved, set_pose=True)[0] == 1
    world.step(1)
    leaf = world.data.body("door/leaf")
    assert leaf.xpos.tolist() == pytest.approx([5, 0, 0])


def test_the_state_of_everything_else_is_carried_over_bit_by_bit(world):
    world.data.ctrl[0] = 0.7
    world.data.mocap_pos[0] = [4, 5, 6]
    world.step(321)
    before, time = state_of(world), world.time_ns
    world.spawn("door", DOOR)
    joints, controls, mocap = state_of(world)
    assert {name: joints[name] for name in before[0]} == before[0]
    assert controls["0"] == 0.7
    assert [4.0, 5.0, 6.0] in mocap
    assert world.time_ns == time
    assert world.data.time == pytest.approx(time / 1e9)
    assert world.simulation.step == 321
    assert world.simulation.epoch == 0
    world.ask("DeleteEntity", entity="door")
    assert state_of(world) == before


def test_the_steps_after_adding_and_removing_something_are_those_without_it():
    changed, plain = StandardWorld(), StandardWorld()
    for world in (changed, plain):
        world.step(50)
    changed.spawn("mug", initial_pose={"pose": {"position": {"z": 50.0}, "orientation": {"w": 1.0}}})
    changed.ask("DeleteEntity", entity="mug")
    assert changed.model is not plain.model
    for world in (changed, plain):
        world.step(200)
    assert changed.data.qpos.tobytes() == plain.data.qpos.tobytes()
    assert changed.data.qvel.tobytes() == plain.data.qvel.tobytes()


def test_unnamed_elements_stay_unnamed(world):
    world.spawn("mug")
    assert [mujoco.mj_id2name(world.model, mujoco.mjtObj.mjOBJ_GEOM, i) for i in range(3)].count(None) == 2
    assert "body_7" in names(world)


def test_an_original_entity_is_removed_and_comes_back_with_a_complete_reset(world):
    world.data.ctrl[0] = 0.5
    world.step(10)
    shoulder = world.data.qpos[world.model.joint("shoulder").qposadr[0]]
    assert world.code("DeleteEntity", entity="cup")[0] == 1
    assert "cup" not in names(world)
    assert world.data.qpos[world.model.joint("shoulder").qposadr[0]] == shoulder
    assert world.code("DeleteEntity", entity="body_7")[0] in (1, 2)
    assert world.code("DeleteEntity", entity="arm")[0] == 1
    assert world.model.nu == 0
    world.spawn("mug")
    assert world.code("ResetSimulation", scope=4)[0] == 1
    assert "mug" not in names(world)
    assert "cup" not in names(world)
    assert world.code("ResetSimulation", scope=255)[0] == 1
    assert "cup" in names(world)
    assert world.time_ns == 0
    assert world.model.nu == 1


def test_a_reset_restores_the_initial_state_of_what_is_still_there(world):
    world.spawn("mug", initial_pose=POSE)
    world.step(200)
    world.ask("ResetSimulation", scope=2)
    assert world.ask("GetEntityState", entity="cup").state.pose.position.z == 1.0
    assert world.ask("GetEntityState", entity="mug").state.pose.position.z == 3.0


def test_ten_entities_appear_together_in_one_change(world):
    requests = [
        {"name": f"mug{i}", "entity_resource": {"resource_string": CUP},
         "initial_pose": {"pose": {"position": {"x": float(i)}, "orientation": {"w": 1.0}}}}
        for i in range(10)
    ]  # fmt: skip
    response = world.ask("SpawnEntities", spawn_requests=requests)
    assert response.result.result == 1
    assert [result.entity_name for result in response.results] == [f"mug{i}" for i in range(10)]
    assert world.simulation.generation == 1


def test_entities_that_fail_are_left_out_and_the_others_appear(world):
    broken = "<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>"
    requests = [
        {"name": "a", "entity_resource": {"resource_string": CUP}},
        {"name": "a", "entity_resource": {"resource_string": CUP}},
        {"name": "b", "entity_resource": {"resource_string": broken}},
        {"name": "c", "entity_resource": {"resource_string": CUP}},
        {"name": "../d", "entity_resource": {"resource_string": CUP}},
    ]
    response = world.ask("SpawnEntities", spawn_requests=requests)
    assert response.result.result == 150
    assert [result.result.result for result in response.results] == [1, 101, 106, 1, 102]
    assert {"a", "c"} <= set(names(world))
    assert "b" not in names(world)
    assert world.simulation.generation == 1


@pytest.mark.parametrize(
    ("name", "text", "fields", "code"),
    [
        ("cup", CUP, {}, 101),
        ("hand", CUP, {}, 101),
        ("a/b", CUP, {}, 102),
        ("..", CUP, {}, 102),
        ("a\nb", CUP, {}, 102),
        ("1a", CUP, {}, 102),
        ("a" * 101, CUP, {}, 102),
        ("é", CUP, {}, 102),
        ("", "<mujoco><worldbody/></mujoco>", {}, 102),
        ("x", "<sdf version='1.7'/>", {}, 103),
        ("x", "file:///etc/passwd", {}, 104),
        ("x", "../../etc/passwd", {}, 104),
        ("x", "package://nothing/here.xml", {}, 104),
        ("x", "https://example.org/cup.xml", {}, 104),
        ("x", "bundled:nothing", {}, 104),
        ("x", CUP, {"entity_namespace": "a b"}, 105),
        ("x", "<mujoco", {}, 106),
        ("x", "<mujoco><worldbody><bod/></worldbody></mujoco>", {}, 106),
        ("x", "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", {}, 106),
        ("x", "<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco/>", {}, 106),
        ("x", "<mujoco><asset><mesh file='/etc/passwd'/></asset></mujoco>", {}, 108),
        ("x", "<mujoco><include file='/etc/passwd'/></mujoco>", {}, 108),
        ("x", "<mujoco><compiler meshdir='/etc'/></mujoco>", {}, 108),
        ("x", MANY, {}, 108),
        ("x", HUGE, {}, 108),
        ("x", "<mujoco><size memory='900G'/></mujoco>", {}, 108),
        ("x", "<mujoco><worldbody>" + "<body>" * 21000 + "</body>" * 21000 + "</worldbody></mujoco>", {}, 108),
        ("x", CUP, {"initial_pose": {"pose": {"position": {"x": float("nan")}, "orientation": {"w": 1.0}}}}, 109),
        ("x", CUP, {"initial_pose": {"pose": {"orientation": {"w": 0.0}}}}, 109),
        ("x", CUP, {"initial_pose": {"header": {"frame_id": "nowhere"}}}, 0),
    ],
)  # fmt: skip
def test_a_refused_spawn_has_its_code_and_changes_nothing(world, name, text, fields, code):
    world.step(3)
    before = state_of(world), names(world), world.model
    response = world.spawn(name, text, **fields)
    assert (response.result.result, response.entity_name) == (code, ""), response.result.error_message
    assert response.result.error_message
    assert (state_of(world), names(world)) == before[:2]
    assert world.model is before[2]
    assert world.spawn("mug").result.result == 1


def test_a_request_without_resource_is_refused(world):
    assert world.code("SpawnEntity", name="x")[0] == 104


def test_names_are_chosen_from_the_model_and_with_numbers(world):
    assert world.spawn("").result.result == 101
    assert world.spawn("", allow_renaming=True).entity_name == "cup_1"
    assert world.spawn("cup", allow_renaming=True).entity_name == "cup_2"
    assert world.spawn("", DOOR).entity_name == "door"
    nameless = "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"
    assert world.spawn("", nameless, allow_renaming=True).entity_name == "model_1"
    assert world.spawn("1 2", CUP, allow_renaming=True).result.result == 102


def test_files_below_the_folders_are_listed_and_spawned(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "cup.xml").write_text(CUP)
    (tmp_path / "in" / "bad.xml").write_text("<mujoco><x/></mujoco>")
    (tmp_path / "in" / "link.xml").symlink_to(tmp_path / "secret.xml")
    (tmp_path / "secret.xml").write_text(CUP)
    world = StandardWorld(folders=[tmp_path / "in"])
    response = world.ask("GetSpawnables", sources=["elsewhere"])
    assert "elsewhere" in response.result.error_message
    found = {item.entity_resource.uri: item for item in response.spawnables}
    cup = found[(tmp_path / "in" / "cup.xml").as_uri()]
    assert cup.spawn_bounds.points[0].z == pytest.approx(0.05)
    assert "cannot be spawned" in found[(tmp_path / "in" / "bad.xml").as_uri()].description
    assert "bundled:box" in found
    assert world.spawn("a", cup.entity_resource.uri).result.result == 1
    assert world.spawn("b", "cup.xml").result.result == 1
    assert world.spawn("c", "bundled:box").result.result == 1
    assert world.spawn("d", "link.xml").result.result == 104
    assert world.spawn("e", (tmp_path / "secret.xml").as_uri()).result.result == 104
    assert world.spawn("f", "../secret.xml").result.result == 104


def test_a_pose_in_the_frame_of_an_entity_is_composed(world):
    pose = {"header": {"frame_id": "ball"}, **POSE}
    assert world.spawn("mug", initial_pose=pose).result.result == 1
    assert world.ask("GetEntityState", entity="mug").state.pose.position.x == 0


def test_options_that_the_model_loses_are_reported(world):
    response = world.spawn("x", DOOR.replace("<worldbody>", "<option timestep='0.01'/><worldbody>"))
    assert response.result.result == 1
    assert "timestep" in response.result.error_message
    assert world.model.opt.timestep == 0.002


def test_physics_does_not_wait_for_the_compiler(world, monkeypatch):
    compiling, go = threading.Event(), threading.Event()
    compose = recipes.compose

    def slow(recipe):
        compiling.set()
        assert go.wait(60)
        return compose(recipe)

    monkeypatch.setattr("mjplug.services.standard.world_builder.compose", slow)
    call = world.send("SpawnEntity", name="mug", entity_resource={"resource_string": CUP})
    assert compiling.wait(60)
    world.step(500)
    assert world.simulation.step == 500
    assert not call.answered
    go.set()
    while not call.answered:
        world.loop.turn()
    assert call.response.result.result == 1


def test_with_spawn_wait_no_step_is_taken_meanwhile(monkeypatch):
    world = StandardWorld(spawn_wait=True, paused=False)
    go, compose = threading.Event(), recipes.compose
    monkeypatch.setattr(
        "mjplug.services.standard.world_builder.compose", lambda recipe: (go.wait(60), compose(recipe))[1]
    )
    call = world.send("SpawnEntity", name="mug", entity_resource={"resource_string": CUP})
    for _ in range(5):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    assert world.simulation.step == 0
    go.set()
    while not call.answered:
        world.loop.turn()
    assert not world.loop.lockstep


def test_two_clients_that_spawn_the_same_name_at_once_get_one_entity(world):
    calls = [
        world.send("SpawnEntity", name="mug", entity_resource={"resource_string": text}) for text in (CUP, CUP, DOOR)
    ]
    calls.append(world.send("SpawnEntity", name="mug", allow_renaming=True, entity_resource={"resource_string": CUP}))
    while not all(call.answered for call in calls):
        world.loop.turn()
    assert [call.response.result.result for call in calls] == [1, 101, 101, 1]
    assert calls[-1].response.entity_name == "mug_1"


def test_two_clients_that_delete_the_same_entity_at_once(world):
    world.spawn("mug")
    calls = [world.send("DeleteEntity", entity=name) for name in ("mug", "cup", "mug", "ball")]
    while not all(call.answered for call in calls):
        world.loop.turn()
    assert [call.response.result.result for call in calls] == [1, 1, 2, 1]


def test_a_reset_during_a_spawn_refuses_it_and_the_next_one_works(world, monkeypatch):
    go, compose = threading.Event(), recipes.compose
    monkeypatch.setattr(
        "mjplug.services.standard.world_builder.compose", lambda recipe: (go.wait(60), compose(recipe))[1]
    )
    call = world.send("SpawnEntity", name="mug", entity_resource={"resource_string": CUP})
    world.loop.reset(Reset())
    assert call.refusal == "cancelled: the world was reset"
    go.set()
    assert world.spawn("mug").result.result == 1
    assert world.simulation.generation == 1


def test_the_generation_is_published(world):
    world.spawn("mug")
    world.ask("DeleteEntity", entity="cup")
    first, second, third = world.published("/mjplug/model_changed")
    assert (first.generation, second.generation, third.generation) == (0, 1, 2)
    assert (second.added, second.removed) == (("mug",), ())
    assert (third.added, third.removed) == ((), ("cup",))
    assert len({first.model_digest, second.model_digest, third.model_digest}) == 3


def test_states_of_another_model_are_refused_and_fit_again_when_it_is_back(world):
    world.step(5)
    state = world.save()
    world.spawn("mug")
    with pytest.raises(Exception, match="entities were added or removed"):
        world.restore(state)
    other = world.save()
    assert other.header.model_generation == 1
    world.restore(other)
    world.ask("DeleteEntity", entity="mug")
    world.restore(state)
    assert world.simulation.step == 5


def test_a_model_that_cannot_be_compiled_again_has_no_spawning():
    world = StandardWorld(mujoco.MjModel.from_xml_string(SCENE))
    features = set(world.ask("GetSimulatorFeatures").features.features)
    assert not features & {0, 1, 9, 14, 23, 50}
    for service in ("SpawnEntity", "SpawnEntities", "DeleteEntity", "GetSpawnables"):
        assert world.code(service)[0] == 0
    assert {0, 1, 9, 14, 23, 50} <= set(StandardWorld().ask("GetSimulatorFeatures").features.features)


def test_sensors_and_forces_belong_to_the_changed_model(world):
    world.spawn("door", DOOR, initial_pose=POSE)
    world.data.ctrl[world.model.actuator("door/opener").id] = 0.3
    world.step(200)
    angle = world.data.qpos[world.model.joint("door/hinge").qposadr[0]]
    assert 0.01 < world.data.sensor("door/angle").data[0] <= angle
    assert np.isfinite(world.data.qpos).all()
