"""The drawing pack against the model that it was made from."""

import cv2
import mujoco
import numpy as np
import pytest
from services.view_packs import EVERYTHING, Pack

from mjplug.services.view.pack import build


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(EVERYTHING)


@pytest.fixture(scope="module")
def pack(model):
    return Pack(build(model))


def test_equal_models_give_equal_packs(model):
    assert build(model) == build(mujoco.MjModel.from_xml_string(EVERYTHING))


def test_each_corner_of_a_mesh_has_the_position_the_normal_and_the_texture_coordinates_of_the_model(model, pack):
    (entry,) = pack.header["meshes"]
    mesh = entry["id"]
    corners = pack.array(entry["indices"])
    assert pack.array(entry["indices"]).dtype == np.uint16
    face, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    assert len(corners) == 3 * count

    def expected(values, first, indices):
        return values[first + indices[face : face + count].ravel()]

    positions = expected(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_face)
    normals = expected(model.mesh_normal, model.mesh_normaladr[mesh], model.mesh_facenormal)
    uv = expected(model.mesh_texcoord, model.mesh_texcoordadr[mesh], model.mesh_facetexcoord)
    np.testing.assert_array_equal(pack.array(entry["positions"])[corners], positions)
    np.testing.assert_allclose(pack.array(entry["normals"])[corners] / 127.0, normals, atol=0.5 / 127)
    np.testing.assert_array_equal(pack.array(entry["uv"])[corners], uv)


def test_geoms_are_where_mujoco_computes_them(model, pack):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = pack.header["bodies"]
    assert [geom["name"] for geom in pack.header["geoms"][:4]] == ["ground", "terrain", "glass", "link"]
    for geom in pack.header["geoms"]:
        body = bodies[geom["body"]]
        rotation, offset, quat, matrix = np.empty(9), np.empty(3), np.empty(4), np.empty(9)
        mujoco.mju_quat2Mat(rotation, np.array(body["quat"]))
        offset = rotation.reshape(3, 3) @ geom["pos"]
        mujoco.mju_mulQuat(quat, np.array(body["quat"]), np.array(geom["quat"]))
        mujoco.mju_quat2Mat(matrix, quat)
        np.testing.assert_allclose(body["pos"] + offset, data.geom_xpos[geom["id"]], atol=1e-12)
        np.testing.assert_allclose(matrix, data.geom_xmat[geom["id"]], atol=1e-12)


def test_a_transparent_geom_and_its_mesh_are_left_out(pack):
    names = {geom["name"] for geom in pack.header["geoms"]}
    assert "hidden" not in names
    assert "glass" in names
    assert len(pack.header["meshes"]) == 1


def test_a_geom_without_a_colour_of_its_own_has_the_colour_of_its_material(pack):
    colors = {geom["name"]: geom["rgba"] for geom in pack.header["geoms"]}
    assert colors["ground"] == pytest.approx([0.9, 0.8, 0.7, 1.0])
    assert colors["glass"] == pytest.approx([0.0, 1.0, 0.0, 0.25])
    assert colors["link"] == pytest.approx([0.5, 0.5, 0.5, 1.0])


def test_textures_are_png_images_with_the_pixels_of_the_model(model, pack):
    assert [texture["type"] for texture in pack.header["textures"]] == ["2d", "skybox"]
    for index, texture in enumerate(pack.header["textures"]):
        image = cv2.imdecode(np.frombuffer(pack.file(texture["png"]), np.uint8), cv2.IMREAD_COLOR_RGB)
        start, size = model.tex_adr[index], image.size
        np.testing.assert_array_equal(image.ravel(), model.tex_data[start : start + size])
    striped = pack.header["materials"][0]
    assert (striped["texture"], striped["texrepeat"]) == (0, [3.0, 2.0])


def test_a_height_field_and_a_cloth_have_the_values_of_the_model(model, pack):
    (hills,) = pack.header["hfields"]
    np.testing.assert_array_equal(
        pack.array(hills["elevation"]), np.arange(12, dtype=np.float32).reshape(3, 4)[::-1] / 11
    )
    (cloth,) = pack.header["flexes"]
    elements = pack.array(cloth["elements"])
    np.testing.assert_array_equal(elements.ravel(), model.flex_elem)
    assert elements.shape == (12, 3)
    assert cloth["vertices"] == 12


def test_a_flex_has_the_texture_coordinates_that_mujoco_draws():
    model = mujoco.MjModel.from_xml_string("""
<mujoco><asset><texture name="checks" type="2d" builtin="checker" width="8" height="8"/>
  <material name="checked" texture="checks"/></asset>
  <worldbody>
    <flexcomp name="sheet" type="grid" count="2 3 1" radius=".01" dim="2" material="checked"><edge equality="true"/>
    </flexcomp>
    <flexcomp name="block" type="grid" count="3 3 3" radius=".01" dim="3" material="checked"><edge equality="true"/>
    </flexcomp>
    <flexcomp name="plain" type="grid" count="2 3 1" radius=".01" dim="2"><edge equality="true"/></flexcomp>
  </worldbody></mujoco>""")
    pack = Pack(build(model))
    sheet, block, plain = pack.header["flexes"]
    corners, uv = pack.array(sheet["uv_elements"]), pack.array(sheet["uv"])
    np.testing.assert_array_equal(uv[corners][0], model.flex_texcoord[model.flex_elemtexcoord[:3]])
    assert corners.shape == pack.array(sheet["elements"]).shape
    np.testing.assert_array_equal(uv.max(axis=0), [1.0, 1.0])
    np.testing.assert_array_equal(pack.array(block["uv_elements"]), pack.array(block["elements"]))
    first = model.flex_texcoordadr[1]
    np.testing.assert_array_equal(pack.array(block["uv"]), model.flex_texcoord[first : first + 27])
    assert "uv" not in plain


def test_bodies_that_can_move_are_named_and_the_others_are_not(model, pack):
    names = [pack.header["bodies"][body]["name"] for body in pack.header["moving"]]
    assert names[:5] == ["arm", "hand", "ball", "ghost", "ghost_child"]
    assert "post" not in names
    assert "world" not in names
    assert len(names) == model.nbody - 2


def test_joints_and_actuators_have_their_limits(pack):
    assert pack.header["joints"][0] == {"name": "hinge", "type": "hinge", "body": 2, "range": [-1.0, 2.0]}
    assert pack.header["joints"][1]["range"] is None
    assert pack.header["actuators"] == [{"name": "torque", "joint": 0, "controls": [[-3.0, 4.0]]}]
    assert pack.header["keyframes"] == ["up"]
    assert pack.header["name"] == "everything"


_DETAILS = """
<mujoco>
  <asset>
    <texture name="linear" type="2d" builtin="flat" width="4" height="4"/>
    <texture name="srgb" type="2d" builtin="flat" width="4" height="4" colorspace="sRGB"/>
    <material name="checked" texture="linear" rgba=".2 .4 .6 1"/>
  </asset>
  <worldbody>
    <light name="lamp" mode="targetbody" target="ball" pos="1 2 3" dir="0 0 -1"/>
    <body name="ball" pos="0 0 1"><freejoint/><geom size=".1"/><light name="escort" mode="track" pos="0 0 2"/></body>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="0 2 1" radius=".01" dim="2" mass="1"
              material="checked"/>
    <flexcomp name="jelly" type="grid" count="3 3 3" spacing=".1 .1 .1" pos="0 4 1" radius=".01" dim="3" mass="1"
              flatskin="true"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def details():
    model = mujoco.MjModel.from_xml_string(_DETAILS)
    return model, Pack(build(model))


def test_lights_name_their_mode_and_the_body_that_they_look_at(details):
    model, pack = details
    lamp, escort = pack.header["lights"]
    assert (lamp["mode"], lamp["target"]) == ("targetbody", model.body("ball").id)
    assert (escort["mode"], escort["target"]) == ("track", -1)
    np.testing.assert_allclose(escort["pos0"], model.light_pos0[1])
    np.testing.assert_allclose(escort["dir0"], model.light_dir0[1])


def test_textures_name_their_colour_space(details):
    assert [texture["srgb"] for texture in details[1].header["textures"]] == [False, True]


def test_flexes_have_the_colour_of_their_material_and_the_texture_coordinates_of_their_corners(details):
    model, pack = details
    cloth, jelly = pack.header["flexes"]
    assert cloth["rgba"] == pytest.approx([0.2, 0.4, 0.6, 1.0])
    assert (cloth["flat"], jelly["flat"]) == (False, True)
    corners = pack.array(cloth["uv_elements"])
    assert corners.shape == pack.array(cloth["elements"]).shape
    np.testing.assert_array_equal(corners.ravel(), model.flex_elemtexcoord[: corners.size])
    uv = pack.array(cloth["uv"])[corners.ravel()]
    np.testing.assert_array_equal(uv, model.flex_texcoord[model.flex_elemtexcoord[: corners.size]])
