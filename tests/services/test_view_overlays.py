"""Overlays of the view against the quantities that MuJoCo computes."""

import struct

import mujoco
import numpy as np
import pytest

from mjplug.services.view import overlays

MODEL = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <body name="ball" pos="0 0 .0999"><freejoint/><geom size=".1" mass="1"/></body>
    <body name="arm" pos="1 0 1"><joint name="hinge" axis="0 1 0" pos=".1 0 0"/><geom type="box" size=".3 .1 .1"/>
      <site name="a" pos=".2 0 0"/><site name="laser" pos="0 0 -.2" euler="180 0 0"/></body>
    <site name="b" pos="2 0 2"/>
  </worldbody>
  <tendon><spatial name="rope"><site site="a"/><site site="b"/></spatial></tendon>
  <actuator><motor joint="hinge"/></actuator>
  <sensor><rangefinder site="laser"/></sensor>
</mujoco>
"""
SHAPE = np.dtype([("pos", "<f4", 3), ("mat", "<f4", 9), ("size", "<f4", 3), ("rgba", "u1", 4), ("type", "<u4")])
GEOM = mujoco.mjtGeom


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(MODEL)


@pytest.fixture
def data(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def shapes(model, data, kind, grips=()):
    payload = overlays.OverlayWriter(model).write(data, kind, 1.5, 2, grips)
    time, epoch, count = struct.unpack_from("<dII", payload)
    assert (time, epoch, len(payload)) == (1.5, 2, 16 + 68 * count)
    return np.frombuffer(payload, SHAPE, offset=16)


def test_contacts_are_where_mujoco_finds_them(model, data):
    (contact,) = shapes(model, data, "contacts")
    np.testing.assert_allclose(contact["pos"], data.contact[0].pos, atol=1e-6)
    assert contact["type"] == GEOM.mjGEOM_CYLINDER


def test_a_contact_force_points_along_the_normal(model, data):
    (force,) = shapes(model, data, "contact_forces")
    np.testing.assert_allclose(force["pos"], data.contact[0].pos, atol=1e-6)
    np.testing.assert_allclose(np.abs(force["mat"].reshape(3, 3)[:, 2]), (0, 0, 1), atol=1e-6)


def test_joints_are_at_their_anchors(model, data):
    drawn = shapes(model, data, "joints")
    hinge = model.joint("hinge").id
    assert any(np.allclose(shape["pos"], data.xanchor[hinge], atol=1e-6) for shape in drawn)


def test_a_tendon_goes_from_site_to_site(model, data):
    (segment,) = shapes(model, data, "tendons")
    start, end = data.site("a").xpos, data.site("b").xpos
    np.testing.assert_allclose(segment["pos"], (start + end) / 2, atol=1e-6)
    length = np.linalg.norm(end - start)
    assert segment["size"][2] == pytest.approx(length / 2, rel=1e-5)


def test_body_frames_are_axes_that_start_at_the_bodies(model, data):
    drawn = shapes(model, data, "frames")
    axes = {tuple(np.round(shape["pos"] - shape["size"][2] * shape["mat"].reshape(3, 3)[:, 2], 4)) for shape in drawn}
    starts = {tuple(np.round(position, 4)) for position in data.xpos[1:].astype(np.float32)}
    assert starts <= axes


def test_inertia_is_a_shape_at_the_centre_of_mass_of_each_moving_body(model, data):
    drawn = shapes(model, data, "inertia")
    np.testing.assert_allclose(drawn["pos"], data.xipos[1:], atol=1e-6)


@pytest.mark.parametrize("kind", list(overlays.KINDS))
def test_every_kind_draws_something_and_no_body(model, data, kind):
    grips = [(model.body("ball").id, (0.0, 0.0, 0.1), (1.0, 0.0, 1.0), None)]
    drawn = shapes(model, data, kind, grips)
    assert len(drawn)
    assert not np.isin(drawn["type"], (GEOM.mjGEOM_PLANE, GEOM.mjGEOM_MESH)).any()


def test_a_perturbation_is_a_line_from_the_dragged_point_to_the_target(model, data):
    arm = model.body("arm").id
    grips = [
        (model.body("ball").id, (0.0, 0.0, 0.1), (1.0, 0.0, 2.0), None),
        (arm, (0.0, 0.0, 0.0), None, (0, 1, 0, 0)),
    ]
    line, target, point, box, origin = shapes(model, data, "perturbation", grips)
    start, end = data.body("ball").xpos + (0.0, 0.0, 0.1), np.array((1.0, 0.0, 2.0))
    np.testing.assert_allclose(line["pos"], (start + end) / 2, atol=1e-6)
    np.testing.assert_allclose(line["size"][2], np.linalg.norm(end - start) / 2, rtol=1e-5)
    np.testing.assert_allclose([target["pos"], point["pos"]], [end, start], atol=1e-6)
    # The body that is turned has a box with the orientation that it is turned to.
    assert box["type"] == GEOM.mjGEOM_LINEBOX
    np.testing.assert_allclose(box["pos"], data.xipos[arm], atol=1e-6)
    turned, wanted, quat = np.empty(9), np.empty(4), np.array((0.0, 1.0, 0.0, 0.0))
    mujoco.mju_mulQuat(wanted, quat, model.body_iquat[arm])
    mujoco.mju_quat2Mat(turned, wanted)
    np.testing.assert_allclose(box["mat"], turned, atol=1e-6)
    np.testing.assert_allclose(origin["pos"], data.xpos[arm], atol=1e-6)
    assert len(shapes(model, data, "perturbation")) == 0


def test_an_empty_model_has_empty_overlays():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert all(len(shapes(model, data, kind)) == 0 for kind in overlays.KINDS if kind != "frames")
