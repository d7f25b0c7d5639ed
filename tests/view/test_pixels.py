"""The page draws what MuJoCo's renderer draws: every kind of object is visible, in place and in its colour."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from view.native import Native, changed, difference, fixed_camera, free_camera, options, similarity
from view.scenes import ALL_FEATURES
from view.studio import Server, Studio

import mjplug

BUNDLED = Path(mjplug.__file__).parent / "bundled"
STEPS = 60
GEOMS = [
    "ground",
    "ramp",
    "platform",
    "terrain",
    "sphere",
    "capsule",
    "ellipsoid",
    "cylinder",
    "box",
    "wedge",
    "gem",
    "glass",
    "cube",
    "globe",
    "barrel",
    "pill",
    "ball",
    "crate",
    "lantern",
    "arm",
    "free",
    "ghost",
]
FLEXES = ("cloth", "jelly", "rope")
SITES = ("mark", "anchor", "tip")
MIN_PIXELS = 25
"""An object of which fewer pixels are visible is no test."""

CLOSE = 12
"""Maximum mean difference to MuJoCo's pixels of an object, 0 to 255. MuJoCo computes light only at vertices."""


class Comparison:
    """The page and MuJoCo's renderer with the same state."""

    def __init__(self, browser, server, size=(900, 560)):
        self.server = server
        self.native = Native(server.model)
        self.page = Studio(browser, [server], size)
        self.page.show()
        self.picture = self.page.picture()
        self.size = self.picture.shape[1], self.picture.shape[0]
        self.expected = self.native_picture()

    def native_picture(self, **arguments):
        return self.native.picture(self.server.data, self.size, **arguments)

    def close(self):
        self.native.close()
        self.page.close()


@pytest.fixture(scope="module")
def comparison(browser):
    model = mujoco.MjModel.from_xml_string(ALL_FEATURES)
    server = Server(model)
    for _ in range(STEPS):
        mujoco.mj_step(model, server.data)
    mujoco.mj_forward(model, server.data)
    pair = Comparison(browser, server)
    yield pair
    pair.close()


def without(values, index):
    """Makes an object invisible; returns a function that restores it."""
    before = values[index].copy()
    values[index] = (0.1, 0.1, 0.1, 0.0)
    return lambda: values.__setitem__(index, before)


def check_object(comparison, rgba, index):
    """Checks the pixels of the picture in which an object can be seen, according to MuJoCo's renderer."""
    restore = without(rgba, index)
    absent = comparison.native_picture()
    restore()
    visible = changed(comparison.expected, absent)
    assert visible.sum() >= MIN_PIXELS
    to_expected = difference(comparison.picture, comparison.expected, visible)
    to_absent = difference(comparison.picture, absent, visible)
    assert to_expected < CLOSE
    assert to_expected < 0.5 * to_absent


def test_the_whole_picture_is_that_of_mujoco(comparison):
    assert similarity(comparison.picture, comparison.expected) > 0.98
    assert difference(comparison.picture, comparison.expected) < 2


@pytest.mark.parametrize("name", GEOMS)
def test_a_geom_is_visible_in_place_and_in_its_colour(comparison, name):
    model = comparison.server.model
    check_object(comparison, model.geom_rgba, model.geom(name).id)


@pytest.mark.parametrize("name", SITES)
def test_a_site_is_visible(comparison, name):
    model = comparison.server.model
    check_object(comparison, model.site_rgba, model.site(name).id)


@pytest.mark.parametrize("name", FLEXES)
def test_a_deformable_object_is_visible(comparison, name):
    model = comparison.server.model
    check_object(comparison, model.flex_rgba, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name))


def test_a_skin_is_visible(comparison):
    check_object(comparison, comparison.server.model.skin_rgba, 0)


def test_the_sky_has_the_colours_of_the_skybox(comparison):
    rows = slice(0, 6)
    assert difference(comparison.picture[rows], comparison.expected[rows]) < 3


def test_the_picture_of_a_camera_of_the_model_is_that_of_mujoco(comparison):
    model, page = comparison.server.model, comparison.page
    page.redraw("stage.lookThrough(world, arg)", model.camera("fixed").id)
    picture = page.picture()
    page.redraw("stage.lookThrough(world, null)")
    expected = comparison.native_picture(camera=fixed_camera(model, "fixed"))
    assert similarity(picture, expected) > 0.98
    assert difference(picture, expected) < 2
    assert difference(page.picture(), comparison.picture) == 0


@pytest.mark.parametrize(
    ("azimuth", "elevation", "distance"), [(30, -5, 4), (200, 15, 3), (-60, -80, 6), (120, -25, 15)]
)
def test_the_picture_from_anywhere_is_that_of_mujoco(comparison, azimuth, elevation, distance):
    model, page = comparison.server.model, comparison.page
    camera = free_camera(model)
    camera.azimuth, camera.elevation, camera.distance = azimuth, elevation, distance
    expected = comparison.native_picture(camera=camera)
    a, e = np.radians([azimuth, elevation])
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    position = np.array(camera.lookat) - distance * forward
    page.redraw(
        "(stage.controls.minDistance = 0, stage.controls.maxPolarAngle = Math.PI,"
        " stage.camera.position.fromArray(arg), stage.controls.update())",
        position.tolist(),
    )
    picture = page.picture()
    page.redraw("stage.resetCamera()")
    assert similarity(picture, expected) > 0.95
    assert difference(picture, expected) < 4


def test_shadows_are_those_of_mujoco(studio):
    model = mujoco.MjModel.from_xml_path(str(BUNDLED / "quadruped.xml"))
    server = Server(model)
    mujoco.mj_resetDataKeyframe(model, server.data, 0)
    mujoco.mj_forward(model, server.data)
    page = studio(server, size=(900, 560))
    page.show()
    plain = page.picture()
    page.redraw("stage.setShadows(true)")
    picture = page.picture()
    page.redraw("stage.setShadows(false)")
    assert difference(page.picture(), plain) == 0
    native = Native(model)
    size = picture.shape[1], picture.shape[0]
    expected = native.picture(server.data, size, shadows=True)
    # Everything in the shadow is darker than with all lights.
    bright = native.picture(server.data, size)
    native.close()
    dark = (expected.astype(int) - bright).max(axis=2) < -15
    assert dark.sum() > 1000
    assert difference(picture, expected, dark) < CLOSE
    assert difference(picture, expected) < 2


def test_hidden_groups_can_be_shown(comparison):
    page = comparison.page
    page.redraw("world.setGroup('geom', 3, true)")
    picture = page.picture()
    page.redraw("world.setGroup('geom', 3, false)")
    option = options()
    option.geomgroup[3] = 1
    expected = comparison.native_picture(option=option)
    appeared = changed(expected, comparison.expected)
    assert appeared.sum() > MIN_PIXELS
    assert difference(picture, expected, appeared) < CLOSE
    assert difference(comparison.picture, comparison.expected, appeared) < CLOSE


def test_moving_bodies_can_be_transparent(comparison):
    page = comparison.page
    page.redraw("world.setTransparent(true)")
    picture = page.picture()
    page.redraw("world.setTransparent(false)")
    expected = comparison.native_picture(option=options(TRANSPARENT=1))
    appeared = changed(expected, comparison.expected)
    assert appeared.sum() > MIN_PIXELS
    assert difference(picture, expected, appeared) < CLOSE


@pytest.mark.parametrize(
    ("kind", "label", "flags"),
    [
        ("tendons", "Tendons", {"TENDON": 1}),
        ("joints", "Joints", {"JOINT": 1}),
        ("com", "Mass centres", {"COM": 1}),
        ("inertia", "Inertia", {"INERTIA": 1}),
        ("contacts", "Contacts", {"CONTACTPOINT": 1}),
        ("contact_forces", "Contact forces", {"CONTACTFORCE": 1}),
    ],
)
def test_an_overlay_is_what_mujoco_draws(comparison, kind, label, flags):
    page = comparison.page
    page.show_overlay(kind, label)
    picture = page.picture()
    page.hide_overlay(label)
    expected = comparison.native_picture(option=options(**flags))
    appeared = changed(expected, comparison.expected)
    assert appeared.sum() > MIN_PIXELS
    assert difference(picture, expected, appeared) < 2 * CLOSE
    assert difference(picture, expected) < 2
    assert difference(page.picture(), comparison.picture) == 0


def test_the_picture_follows_the_state(comparison):
    server, page = comparison.server, comparison.page
    data = server.data
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    saved = np.empty(mujoco.mj_stateSize(server.model, state))
    mujoco.mj_getState(server.model, data, saved, state)
    data.joint("swing").qpos[0] = -0.8
    data.mocap_pos[0] = -0.5, 0.9, 1.2
    for _ in range(100):
        mujoco.mj_step(server.model, data)
    mujoco.mj_forward(server.model, data)
    page.show()
    picture, expected = page.picture(), comparison.native_picture()
    mujoco.mj_setState(server.model, data, saved, state)
    mujoco.mj_forward(server.model, data)
    page.show()
    moved = changed(expected, comparison.expected)
    assert moved.sum() > 10 * MIN_PIXELS
    assert difference(picture, expected, moved) < CLOSE
    assert difference(page.picture(), comparison.picture) == 0
