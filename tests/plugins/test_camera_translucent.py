"""What depth translucent things have: none. Whole images are compared with rays that pass through them."""

import mujoco
import numpy as np
import pytest
from camera_scenes import (
    closing,  # noqa: F401 - a fixture
    gl,  # noqa: F401 - a fixture
    pixels,
    pose,
    scene,
    seen,
    world_of,
)

EYE = '<camera name="eye" pos="0 -3 1.2" xyaxes="1 0 0 0 .25 .97" resolution="64 48"/>'
SOLID = (
    '<geom type="plane" size="50 50 1"/><geom type="box" size="3 .1 2" pos="0 3 1"/>'
    '<geom type="box" size=".2 .2 .2" pos="-.8 0 .2" euler="0 0 30"/>'
)


def ray_depths(world, info, alphas_hit):
    """Returns the distance along the optical axis to the first geom whose alpha is accepted, in each pixel [m]."""
    model, (position, axes) = world.model, pose(world)
    for geom in range(model.ngeom):
        material = model.geom_matid[geom]
        alpha = model.geom_rgba[geom, 3] if material < 0 else model.mat_rgba[material, 3]
        model.geom_group[geom] = 0 if alphas_hit(alpha) else 5
    groups = np.array([1, 1, 1, 1, 1, 0], np.uint8)
    k = np.array(info.k).reshape(3, 3)
    depths = np.full((info.height, info.width), np.inf)
    for row in range(info.height):
        for column in range(info.width):
            ray = np.array([(column + 0.5 - k[0, 2]) / k[0, 0], (row + 0.5 - k[1, 2]) / k[1, 1], 1.0])
            length = np.linalg.norm(ray)
            found = np.zeros(1, np.int32)
            hit = mujoco.mj_ray(model, world.data, position, axes @ (ray / length), groups, True, -1, found)
            if hit >= 0:
                depths[row, column] = hit / length
    return depths


def disagreement(depth, expected):
    """Returns which share of the pixels is off by more than a thousandth."""
    return 1.0 - np.isclose(depth, expected, rtol=1e-3, atol=0.0).mean()


def behind_glass(alpha, sky=True):
    """A pane in front of the camera, and a box at the side whose material is as translucent."""
    pane = f'<geom type="box" size=".5 .01 .5" pos="0 -1 .6" rgba="1 0 0 {alpha}"/>'
    box = '<geom type="box" size=".3 .2 .3" pos="1 -.5 .4" euler="0 0 20" material="glass"/>'
    xml = scene(EYE, SOLID + pane + box)
    without_sky = xml if sky else xml[: xml.index("<asset>")] + "<asset>" + xml[xml.index("</asset>") :]
    return without_sky.replace("</asset>", f'<material name="glass" rgba="0 1 0 {alpha}"/></asset>')


@pytest.mark.parametrize("quality", ["fast", "full"])
@pytest.mark.parametrize(("alpha", "sky"), [(0.0, True), (0.01, False), (0.4, True), (0.4, False), (0.99, True)])
def test_the_depth_behind_glass_is_that_of_what_stands_behind_it(quality, alpha, sky):
    _, depth, info, world = seen(behind_glass(alpha, sky), quality=quality)
    expected = ray_depths(world, info, lambda alpha: alpha == 1)
    assert disagreement(pixels(depth), expected) == 0


@pytest.mark.parametrize("quality", ["fast", "full"])
@pytest.mark.parametrize("alpha", [0.996, 1])
def test_what_mujoco_draws_as_opaque_has_a_depth(quality, alpha):
    """MuJoCo takes an alpha from 0.995 on for 1."""
    _, depth, info, world = seen(behind_glass(alpha), quality=quality)
    assert disagreement(pixels(depth), ray_depths(world, info, lambda alpha: alpha > 0.995)) == 0
    if alpha < 1:
        assert disagreement(pixels(depth), ray_depths(world, info, lambda alpha: alpha == 1)) > 0.1


OTHERS = {
    "material": '<geom type="box" size=".5 .01 .5" pos="0 -1 .6" material="clear"/>',
    "site": '<site type="box" size=".5 .01 .5" pos="0 -1 .6" rgba="1 0 0 .4"/>',
    "tendon": '<site name="a" size=".001" rgba="0 0 0 0" pos="-1 -1 .8"/>'
    '<site name="b" size=".001" rgba="0 0 0 0" pos="1 -1 .8"/>',
    "flex": '<flexcomp name="cloth" type="grid" dim="2" count="4 4 1" spacing=".3 .3 .1" pos="0 -1 .8" radius=".02" '
    'euler="90 0 0" rgba="1 0 0 .4"><edge equality="true"/></flexcomp>',
}


@pytest.mark.parametrize("quality", ["fast", "full"])
@pytest.mark.parametrize("alone", [False, True], ids=["with colour", "alone"])
@pytest.mark.parametrize("what", OTHERS)
def test_no_translucent_thing_has_a_depth(what, alone, quality):
    def picture(things, **parameters):
        xml = scene(EYE, SOLID + things).replace("</asset>", '<material name="clear" rgba="0 0 1 .4"/></asset>')
        tendon = '<tendon><spatial width=".05" rgba="1 0 0 .4"><site site="a"/><site site="b"/></spatial></tendon>'
        if 'name="a"' in things:
            xml = xml.replace("</mujoco>", f"{tendon}</mujoco>")
        world = world_of(xml, quality=quality, **parameters)
        for topic in ("color", "color/compressed"):
            world.transport.publishers[f"/cameras/eye/{topic}"].matched = not alone
        world.loop.step(100)
        return [pixels(message) for topic in ("color", "depth") for message in world.published(f"/cameras/eye/{topic}")]

    *colours, depth = picture(OTHERS[what], site_groups=(0,))
    *plain_colours, plain_depth = picture("")
    assert np.array_equal(depth, plain_depth)
    for colour, plain_colour in zip(colours, plain_colours, strict=True):
        assert (colour != plain_colour).any(axis=2).mean() > 0.01, "the thing is in the picture"


def test_glass_is_hidden_only_while_a_depth_is_drawn():
    world = world_of(behind_glass(0.4), quality="full", eye={"segmentation": "geom"})
    world.loop.step(200)
    first, second = (pixels(image) for image in world.published("/cameras/eye/color"))
    assert np.array_equal(first, second)
    numbers = pixels(world.published("/cameras/eye/segmentation")[0])
    assert {3, 4} <= set(numbers.flatten().tolist()), "glass is in a segmentation"
