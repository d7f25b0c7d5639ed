import cv2
import mujoco
import numpy as np
import pytest
from camera_scenes import (
    DOWN,
    FLOOR,
    FOVY,
    NARROW,
    SKEW,
    TILTED,
    closing,  # noqa: F401 - a fixture
    gl,  # noqa: F401 - a fixture
    pixels,
    plane_depth,
    pose,
    projected,
    scene,
    seen,
    world_of,
)

CAMERAS = pytest.mark.parametrize("optics", [FOVY, SKEW, NARROW], ids=["fovy", "skew", "narrow"])


def eye(optics=FOVY, where=DOWN, name="eye"):
    return f'<camera name="{name}" {where} {optics}/>'


@CAMERAS
@pytest.mark.parametrize("where", [DOWN, TILTED], ids=["down", "tilted"])
@pytest.mark.parametrize("quality", ["fast", "full"])
def test_the_depth_of_a_floor_is_its_distance_along_the_axis(optics, where, quality):
    _, depth, info, world = seen(scene(eye(optics, where), FLOOR), quality=quality)
    expected = plane_depth(info, *pose(world))
    assert (expected > 0).all()
    assert np.abs(pixels(depth) / expected - 1).max() < 1e-3
    assert np.ptp(pixels(depth)) < 1e-4 if where == DOWN else np.ptp(pixels(depth)) > 0.5


def test_the_depth_is_right_far_away_too():
    """Near and far plane are 0.02 and 100 m: one in 5000."""
    _, depth, info, world = seen(scene(eye(where='pos="0 0 2" euler="88 0 0"'), FLOOR))
    expected = plane_depth(info, *pose(world))
    below = (expected > 0) & (expected < 95)
    assert expected[below].max() > 20
    assert np.abs(pixels(depth)[below] / expected[below] - 1).max() < 1e-3


@pytest.mark.parametrize("alone", [False, True], ids=["with colour", "alone"])
@pytest.mark.parametrize("quality", ["fast", "full"])
def test_sky_and_haze_are_in_no_depth(quality, alone):
    """MuJoCo draws the sky as an object at 0.7 of the far plane, and the haze as an object on an infinite floor."""
    xml = scene(eye(where='pos="0 0 2" euler="85 0 0"'), '<geom type="plane" size="0 0 1"/>')
    world = world_of(xml, quality=quality)
    for topic in ("color", "color/compressed"):
        world.transport.publishers[f"/cameras/eye/{topic}"].matched = not alone
    world.loop.step(100)
    z = pixels(world.published("/cameras/eye/depth")[0])
    expected = plane_depth(world.published("/cameras/eye/camera_info")[0], *pose(world))
    floor = (expected > 0) & (expected < 55)
    assert expected[floor].max() > 40
    assert np.abs(z[floor] / expected[floor] - 1).max() < 1e-3
    assert np.isinf(z[(expected < 0) | (expected > 105)]).all()


def test_the_sky_is_in_the_image_and_turns_with_the_camera():
    """A camera that turns upwards."""
    sky = 'builtin="gradient" rgb1="1 0 0" rgb2="0 0 1"'
    turning = '<body pos="0 0 1"><freejoint/><geom size=".01"/><camera name="eye" resolution="64 48"/></body>'
    xml = scene(turning).replace('builtin="flat" rgb1=".2 .3 .4"', sky)
    world = world_of(xml)
    world.data.qpos[3:] = np.array([1, 1, 0, 0]) / np.sqrt(2)  # along y, level
    world.data.qvel[3] = 2.0
    world.loop.step(300)
    images = [pixels(image)[24, 32].astype(int) for image in world.published("/cameras/eye/color")]
    redness = [int(red) - int(blue) for red, _, blue in images]
    assert len(redness) == 3
    # From the horizon up to the zenith, which is red.
    assert redness[0] < redness[1] < redness[2]


@pytest.mark.parametrize("euler", ["0 0 0", "90 0 0", "60 30 10", "140 -20 70", "180 0 0"])
@pytest.mark.parametrize("optics", [FOVY, SKEW], ids=["fovy", "skew"])
def test_the_sky_is_recognised_from_every_view(euler, optics):
    """With a wall before it, as far away as anything can be."""
    wall = '<geom type="box" size=".1 60 60" pos="64 0 0"/>'
    _, depth, info, world = seen(scene(eye(optics, f'pos="0 0 1" euler="{euler}"'), wall))
    renderer = world.workers.workers["cameras"].work._renderer
    assert renderer._sky_verified
    position, axes = pose(world)
    k = np.array(info.k).reshape(3, 3)
    v, u = np.mgrid[0 : info.height, 0 : info.width] + 0.5
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1) @ axes.T
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (63.9 - position[0]) / rays[..., 0]
        hit = position + to_wall[..., np.newaxis] * rays
    on_wall = (to_wall > 0) & (np.abs(hit[..., 1:]) < 59).all(axis=-1) & (np.hypot(hit[..., 0], hit[..., 1]) < 69)
    off_wall = (to_wall < 0) | (np.abs(hit[..., 1:]) > 61).any(axis=-1)
    z = pixels(depth)
    assert np.isinf(z[off_wall]).all()
    assert np.abs(z[on_wall] / to_wall[on_wall] - 1).max(initial=0.0) < 1e-3


def test_a_sky_that_is_not_where_it_used_to_be_is_left_out_by_drawing_twice(monkeypatch):
    monkeypatch.setattr("mjplug_plugins.camera.sky._RADIUS", 0.8)
    _, depth, info, world = seen(scene(eye(where='pos="0 0 2" euler="85 0 0"'), FLOOR))
    assert world.workers.workers["cameras"].work._renderer._sky_verified is False
    expected = plane_depth(info, *pose(world))
    assert np.isinf(pixels(depth)[expected < 0]).all()


def test_a_colour_image_is_the_same_with_and_without_depth_subscribers():
    xml = scene(eye(where='pos="0 0 2" euler="85 0 0"'), QUARTERS + '<geom type="plane" size="0 0 1"/>')
    world = world_of(xml)
    world.loop.step(100)
    for topic in ("depth", "depth/compressedDepth"):
        world.transport.publishers[f"/cameras/eye/{topic}"].matched = False
    world.loop.step(100)
    together, alone = (pixels(image).astype(int) for image in world.published("/cameras/eye/color"))
    # The sky hides the last few pixels of the floor, at 0.7 of the far plane.
    assert (np.abs(alone - together).max(axis=2) > 1).sum(axis=0).max() <= 1


CORNERS = np.array([(x, y, z) for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])


@CAMERAS
def test_the_corners_of_a_box_land_on_their_pixels(optics):
    box = '<body name="box" pos=".1 .2 .2" euler="10 20 30"><freejoint/><geom type="box" size=".4 .3 .2"/></body>'
    xml = scene(eye(optics, 'pos="1.2 -1.5 2.2" mode="targetbody" target="box"'), box)
    _, depth, info, world = seen(xml)
    body = world.data.body("box")
    corners = projected(info, *pose(world), body.xpos + CORNERS @ body.xmat.reshape(3, 3).T)
    hull = cv2.convexHull(corners.astype(np.float32))
    box_seen = np.isfinite(pixels(depth))
    assert 80 < box_seen.sum() < box_seen.size / 2
    for row, column in np.ndindex(box_seen.shape):
        inside_by = cv2.pointPolygonTest(hull, (column + 0.5, row + 0.5), True)
        assert abs(inside_by) < 0.5 or box_seen[row, column] == (inside_by > 0), (row, column)


@CAMERAS
def test_k_and_p_are_those_of_the_model(optics):
    *_, info, world = seen(scene(eye(optics)))
    expected = {
        FOVY: [24 / np.tan(np.radians(35)), 24 / np.tan(np.radians(35)), 32, 24],
        SKEW: [55, 70, 40 - 9, 30 + 5],
        NARROW: [45 / np.tan(np.radians(20)), 45 / np.tan(np.radians(20)), 25, 45],
    }[optics]
    fx, fy, cx, cy = expected
    assert [info.width, info.height] == world.model.cam_resolution[0].tolist()
    assert info.k == pytest.approx([fx, 0, cx, 0, fy, cy, 0, 0, 1], rel=1e-6)
    assert info.p == pytest.approx([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], rel=1e-6)
    assert info.r == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert (info.distortion_model, info.d) == ("plumb_bob", (0, 0, 0, 0, 0))


def test_an_overridden_size_scales_the_intrinsics_with_the_image():
    """Twice the columns and thrice the rows of the model's resolution."""
    *_, depth, info, world = seen(scene(eye(SKEW, TILTED), FLOOR), eye={"width": 160, "height": 180})
    assert info.k == pytest.approx([110, 0, 2 * 31, 0, 210, 3 * 35, 0, 0, 1], rel=1e-6)
    assert np.abs(pixels(depth) / plane_depth(info, *pose(world)) - 1).max() < 1e-3


def test_an_orthographic_camera_has_depth_but_no_matrices():
    camera = '<camera name="eye" pos="0 0 2" resolution="40 30" projection="orthographic" fovy="3"/>'
    box = '<geom type="box" size=".5 .5 .25" pos="0 0 .25"/>'
    _, depth, info, _ = seen(scene(camera, FLOOR + box))
    z = pixels(depth)
    inside = z < 1.75
    assert np.allclose(z[inside], 1.5, rtol=1e-4)
    assert np.allclose(z[~inside], 2.0, rtol=1e-4)
    # 10 pixels a metre in both directions, however far away.
    assert inside.sum() == 100
    assert (info.k, info.p, info.r) == ((0,) * 9, (0,) * 12, (0,) * 9)
    assert (info.width, info.height, info.d) == (40, 30, ())


QUARTERS = "".join(
    f'<geom type="box" size=".5 .5 .05" pos="{x} {y} 0" rgba="{rgb} 1"/>'
    for x, y, rgb in [(-0.5, 0.5, "1 0 0"), (0.5, 0.5, "0 1 0"), (-0.5, -0.5, "0 0 1"), (0.5, -0.5, "1 1 1")]
)


@pytest.mark.parametrize("quality", ["fast", "full"])
def test_colours_are_red_green_blue_and_the_first_row_is_the_top(quality):
    """From above, with y up in the image: red, green; blue, white."""
    image, *_ = seen(scene(eye(where='pos="0 0 1"'), QUARTERS), quality=quality)
    rgb = pixels(image).astype(int)
    assert (image.encoding, image.is_bigendian, image.step) == ("rgb8", 0, 64 * 3)
    for (row, column), lit in {(8, 8): (1, 0, 0), (8, 56): (0, 1, 0), (40, 8): (0, 0, 1), (40, 56): (1, 1, 1)}.items():
        assert [value > 100 for value in rgb[row, column]] == [bool(x) for x in lit], (row, column)


@pytest.mark.parametrize(("background", "expected"), [("inf", np.inf), ("nan", np.nan), ("far", 100.0), ("zero", 0.0)])
def test_the_background_depth_is_as_configured(background, expected):
    _, depth, *_ = seen(scene(eye(), QUARTERS), background=background)
    z = pixels(depth)
    assert z[24, 32] == pytest.approx(1.95, rel=1e-3)
    assert z[0, 0] == pytest.approx(expected, nan_ok=True)


def test_the_default_background_depth_is_infinite():
    _, depth, *_ = seen(scene(eye(), QUARTERS))
    assert pixels(depth)[0, 0] == np.inf


def test_stamp_and_frame_are_those_of_the_state_and_the_configuration():
    xml = scene(eye(), '<body><freejoint/><geom size=".1"/></body>')
    world = world_of(xml, eye={"frame_name": "optical"}, camera_publish_rate=7.0)
    world.loop.step(300)
    topics = ("color", "depth", "camera_info", "color/compressed", "depth/compressedDepth")
    for topic in topics:
        headers = [message.header for message in world.published(f"/cameras/eye/{topic}")]
        # At the first step at or after each seventh of a second.
        assert [header.stamp.to_ns() for header in headers] == [144_000_000, 286_000_000, 430_000_000, 572_000_000]
        assert {header.frame_id for header in headers} == {"optical"}


def test_an_image_shows_the_very_state_of_its_stamp():
    """A box that comes towards the camera, at one metre a second."""
    box = '<body pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>'
    world = world_of(scene(eye(where='pos="0 0 4"'), box), camera_publish_rate=10.0)
    world.data.qvel[2] = 1.0
    world.loop.step(500)
    depths = world.published("/cameras/eye/depth")
    assert len(depths) == 10
    for depth in depths:
        top = 1.0 + depth.header.stamp.to_ns() / 1e9 + 0.1
        assert pixels(depth)[24, 32] == pytest.approx(4.0 - top, rel=1e-5)


def test_translucent_objects_are_in_no_depth_image():
    glass = '<geom type="box" size=".5 .5 .05" pos="0 0 1" rgba="1 1 1 .3"/>'
    world = world_of(scene(eye(), FLOOR + glass))
    world.loop.step(100)
    world.transport.publishers["/cameras/eye/color"].matched = False
    world.transport.publishers["/cameras/eye/color/compressed"].matched = False
    world.loop.step(100)
    together, alone = world.published("/cameras/eye/depth")
    assert len(world.published("/cameras/eye/color")) == 1
    assert pixels(together) == pytest.approx(2.0, rel=1e-4)
    assert pixels(alone) == pytest.approx(2.0, rel=1e-4)


def test_depth_alone_is_the_same_depth():
    world = world_of(scene(eye(SKEW, TILTED), FLOOR + QUARTERS))
    world.loop.step(100)
    for topic in ("color", "color/compressed"):
        world.transport.publishers[f"/cameras/eye/{topic}"].matched = False
    world.loop.step(100)
    together, alone = (pixels(depth) for depth in world.published("/cameras/eye/depth"))
    assert np.array_equal(together, alone)


THINGS = """
<geom name="ground" type="plane" size="50 50 1"/>
<body name="cart" pos="-.7 0 .3"><freejoint/>
  <geom name="wheel" type="sphere" size=".2" pos="0 .4 0"/><geom name="crate" type="box" size=".2 .2 .2"/></body>
<site type="sphere" size=".3" pos="1 0 .3"/>
"""


@pytest.mark.parametrize("quality", ["fast", "full"])
@pytest.mark.parametrize("kind", ["geom", "body"])
def test_a_segmentation_numbers_geoms_or_bodies(kind, quality):
    xml = scene(eye(where='pos="0 0 3"'), THINGS)
    world = world_of(xml, quality=quality, eye={"segmentation": kind})
    world.loop.step(100)
    (message,) = world.published("/cameras/eye/segmentation")
    ids = pixels(message)
    model = world.model
    geoms = {name: model.geom(name).id for name in ("ground", "wheel", "crate")}
    position, axes = pose(world)
    info = world.published("/cameras/eye/camera_info")[0]
    middles = projected(info, position, axes, [world.data.geom(name).xpos for name in ("wheel", "crate")])
    (wheel_u, wheel_v), (crate_u, crate_v) = middles.astype(int)
    numbers = {name: number if kind == "geom" else int(model.geom_bodyid[number]) for name, number in geoms.items()}
    assert ids[wheel_v, wheel_u] == numbers["wheel"]
    assert ids[crate_v, crate_u] == numbers["crate"]
    assert set(np.unique(ids)) == set(numbers.values())


def test_the_background_of_a_segmentation_is_minus_one():
    world = world_of(scene(eye(), '<geom type="box" size=".2 .2 .2"/>'), eye={"segmentation": "geom"})
    world.loop.step(100)
    ids = pixels(world.published("/cameras/eye/segmentation")[0])
    assert ids[0, 0] == -1
    assert set(np.unique(ids)) == {-1, 0}


def test_rays_and_sites_are_not_drawn_unless_sites_are_asked_for():
    site = '<site name="s" type="sphere" size=".5"/>'
    xml = scene(eye(), site).replace("</mujoco>", '<sensor><rangefinder site="s"/></sensor></mujoco>')
    assert np.isinf(pixels(seen(xml)[1])).all()
    assert np.isfinite(pixels(seen(xml, site_groups=[0])[1])).any()


def test_groups_of_geoms_can_be_chosen():
    geoms = '<geom type="box" size=".3 .3 .3" pos="0 0 .5" group="3"/>' + FLOOR
    xml = scene(eye(), geoms)
    assert pixels(seen(xml)[1]).min() == pytest.approx(2.0, rel=1e-4)
    assert pixels(seen(xml, geom_groups=[0, 3])[1]).min() == pytest.approx(1.2, rel=1e-3)


def test_full_quality_has_shadows_and_fast_has_none():
    visual = '<headlight diffuse="0 0 0" ambient=".1 .1 .1"/>'
    roof = '<geom type="box" size=".5 .5 .05" pos="0 0 2.5"/>'
    xml = scene(eye(), FLOOR + roof, visual).replace('<light pos="0 0 5"/>', '<light pos="0 0 5" dir="0 0 -1"/>')
    fast, full = (pixels(seen(xml, quality=quality)[0])[24, 32].sum() for quality in ("fast", "full"))
    assert full < 0.7 * fast


def test_a_model_of_thousands_of_geoms_is_drawn_completely():
    rows = "".join(
        f'<geom type="box" size=".008 .008 .01" pos="{x / 50:.3f} {y / 50:.3f} 0"/>'
        for x in range(-50, 50)
        for y in range(-30, 30)
    )
    world = world_of(scene(eye('resolution="32 24" fovy="40"', 'pos="0 0 1"'), rows), eye={"segmentation": "geom"})
    assert world.model.ngeom == 6000
    world.loop.step(100)
    ids = pixels(world.published("/cameras/eye/segmentation")[0])
    assert len(np.unique(ids)) > 300
    info = world.published("/cameras/eye/camera_info")[0]
    drawn = np.unique(ids)[1:]
    mujoco.mj_forward(world.model, world.data)
    centres = projected(info, *pose(world), world.data.geom_xpos[drawn])
    assert (np.abs(centres - np.array([16, 12])).max(axis=0) < (17, 13)).all()
