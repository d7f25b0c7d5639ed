"""MJCF models in scenes: the scene replaces their floor, lights and sky."""

import logging

import mujoco
import numpy as np
import pytest

from convert.robots import ARM
from mjplug.convert.load import load_model
from mjplug.convert.options import ConversionOptions
from mjplug.errors import ModelError

MODELS = ("arm", "box", "mobile_base", "quadruped")
SCENES = ("floor", "tabletop", "obstacles")


def in_scene(uri, scene):
    return load_model(str(uri), options=ConversionOptions(scene=scene)).model


def started(model):
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return data


def planes(model):
    return [model.geom(i).name for i in range(model.ngeom) if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_PLANE]


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", MODELS)
def test_each_bundled_model_stands_still_in_each_scene(name, scene):
    alone, model = load_model(f"bundled:{name}").model, in_scene(f"bundled:{name}", scene)
    assert planes(model) == ["scene_floor"]
    assert sum(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX) == 1
    assert (model.opt.timestep, model.opt.cone, model.nu) == (alone.opt.timestep, alone.opt.cone, alone.nu)
    assert [model.key(i).name for i in range(model.nkey)] == [alone.key(i).name for i in range(alone.nkey)]
    assert np.array_equal(model.key_qpos[0][: alone.nq], alone.key_qpos[0])
    data = started(model)
    begin = data.qpos.copy()
    mujoco.mj_step(model, data, 250)
    assert np.abs(data.qpos - begin).max() < 0.01, "also the objects of the scene"
    assert not any(int(warning.number) for warning in data.warning)


def test_objects_of_the_scene_that_would_overlap_the_model_are_left_out_and_named(caplog):
    caplog.set_level(logging.INFO)
    model = in_scene("bundled:quadruped", "obstacles")
    names = {model.body(i).name for i in range(model.nbody)}
    assert {"scene_cone_1", "scene_box"} <= names
    assert "scene_cone_2" not in names, "the model contains a crate at its place"
    assert "would overlap the model are left out: cone_2" in caplog.text


OWN = """<mujoco model="mine"><option timestep="0.004"/>
<asset><texture name="sky" type="skybox" builtin="flat" rgb1="1 0 0" width="8" height="48"/>
<material name="floor" rgba="1 0 0 1"/></asset>
<worldbody><light name="lamp" pos="0 0 3"/><geom name="ground" type="plane" size="1 1 0.1" pos="0 0 -0.5"/>
<geom name="pedestal" type="cylinder" size="0.1 0.25" pos="0 0 -0.25"/>
<body name="link"><joint name="j" axis="0 0 1"/>
<geom name="bar" type="box" size="0.3 0.02 0.02" pos="0.3 0 0.05"/></body>
</worldbody><actuator><position name="j" joint="j" kp="10"/></actuator>
<contact><pair geom1="bar" geom2="ground"/></contact>
<sensor><distance name="height" geom1="bar" geom2="ground" cutoff="9"/></sensor>
<keyframe><key name="turned" qpos="0.7"/></keyframe></mujoco>"""


def test_a_model_keeps_everything_but_its_floor_lights_and_sky(tmp_path):
    (tmp_path / "mine.xml").write_text(OWN)
    model = in_scene(tmp_path / "mine.xml", "floor")
    assert planes(model) == ["scene_floor"]
    assert model.geom("scene_floor").pos[2] == -0.5, "where the floor of the model was"
    assert model.geom("pedestal").type == mujoco.mjtGeom.mjGEOM_CYLINDER
    assert [model.light(i).name for i in range(model.nlight)] == ["scene_sun"]
    assert model.opt.timestep == 0.004
    data = started(model)
    mujoco.mj_forward(model, data)
    assert data.joint("j").qpos[0] == 0.7
    assert data.sensor("height").data[0] == pytest.approx(0.53), "sensors and pairs name the new floor"
    assert {model.pair_geom1[0], model.pair_geom2[0]} == {model.geom("bar").id, model.geom("scene_floor").id}
    tabletop = in_scene(tmp_path / "mine.xml", "tabletop")
    data = started(tabletop)
    mujoco.mj_forward(tabletop, data)
    assert data.geom("scene_table_top").xpos[2] + 0.02 == pytest.approx(-0.5), "a fixed robot is mounted on the table"


def test_a_model_without_a_floor_is_above_that_of_the_scene(tmp_path):
    text = OWN.replace('<geom name="ground" type="plane" size="1 1 0.1" pos="0 0 -0.5"/>', "")
    text = text.replace('<contact><pair geom1="bar" geom2="ground"/></contact>', "").partition("<sensor>")
    (tmp_path / "hung.xml").write_text(text[0].replace('pos="0.3 0 0.05"', 'pos="0.3 0 -0.4"') + "</mujoco>")
    model = in_scene(tmp_path / "hung.xml", "floor")
    assert model.geom("scene_floor").pos[2] == pytest.approx(-0.421)


def test_a_scene_of_the_user_and_no_scene(tmp_path):
    (tmp_path / "mine.xml").write_text(OWN.partition("<contact>")[0] + "</mujoco>")
    (tmp_path / "hall.xml").write_text(
        '<mujoco><worldbody><geom name="hall" type="plane" size="9 9 1"/><body name="rock" pos="3 0 0.2"><freejoint/>'
        '<geom size="0.2"/></body></worldbody></mujoco>'
    )
    model = in_scene(tmp_path / "mine.xml", str(tmp_path / "hall.xml"))
    assert planes(model) == ["scene_hall"]
    assert model.geom("scene_hall").pos[2] == -0.5
    assert model.body("scene_rock").pos.tolist() == [3.0, 0.0, -0.3]
    none = in_scene(tmp_path / "mine.xml", "none")
    assert (planes(none), none.nlight, none.nu) == ([], 0, 1)


def test_what_cannot_be_put_into_a_scene_is_named(tmp_path):
    (tmp_path / "mine.xml").write_text(OWN)
    with pytest.raises(ModelError, match="there is no scene 'tabeltop', did you mean 'tabletop'"):
        in_scene(tmp_path / "mine.xml", "tabeltop")
    (tmp_path / "bad.xml").write_text("<mujoco><nonsense/></mujoco>")
    with pytest.raises(ModelError, match=r"the scene .*bad\.xml cannot be read: .*nonsense"):
        in_scene(tmp_path / "mine.xml", str(tmp_path / "bad.xml"))
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_string(OWN), str(tmp_path / "mine.mjb"), None)
    with pytest.raises(ModelError, match=r"mine\.mjb cannot be put into the scene 'floor'; only URDF, xacro and MJCF"):
        in_scene(tmp_path / "mine.mjb", "floor")
    with pytest.raises(ModelError, match=r"mine\.xml cannot be put into the scene 'none': .*ground"):
        in_scene(tmp_path / "mine.xml", "none")
    (tmp_path / "arm.urdf").write_text(ARM)
    assert load_model(str(tmp_path / "arm.urdf"), options=ConversionOptions(raw=True, scene="floor")).model.nu == 0
