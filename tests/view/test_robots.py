"""Robots with meshes, from wheels on PyPI, as the page and MuJoCo's renderer draw them."""

import shutil
import subprocess
from pathlib import Path

import mujoco
import pytest
from view.conftest import unavailable
from view.native import Native, changed, difference, similarity
from view.studio import Server

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

ROOT = Path(__file__).parents[2]
ROBOTS = {
    "panda": ("gym-hil==0.1.14", "gym_hil/assets/arrange_boxes_scene.xml"),
    "gr1": ("robosuite==1.5.2", "robosuite/models/assets/robots/gr1/robot.xml"),
    "sawyer": ("robosuite==1.5.2", "robosuite/models/assets/robots/sawyer/robot.xml"),
}
"""Package and model by robot."""


def package(config, requirement):
    """Returns the folder with a package, which is downloaded once."""
    folder = Path(config.cache.mkdir("robots")) / requirement
    if not folder.exists():
        uv = shutil.which("uv") or str(ROOT / ".uv" / "bin" / "uv")
        command = [uv, "pip", "install", "--quiet", "--no-deps", "--target", f"{folder}.part", requirement]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            unavailable(f"{requirement} cannot be downloaded: {done.stderr.strip()[-300:]}")
        Path(f"{folder}.part").rename(folder)
    return folder


def load(path):
    """Returns a robot as it is, or with a floor, a light and a sky if the file has no light."""
    spec = mujoco.MjSpec.from_file(str(path))
    if not spec.lights:
        spec.add_texture(
            name="test_sky",
            type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
            builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
            rgb1=(0.5, 0.6, 0.7),
            rgb2=(0.1, 0.1, 0.2),
            width=32,
            height=192,
        )
        light = spec.worldbody.add_light(dir=(0.3, 0.5, -1), castshadow=False)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), pos=(0, 0, -1), rgba=(0.6, 0.6, 0.6, 1)
        )
    return spec.compile()


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_looks_as_in_mujocos_renderer(name, studio, request):
    requirement, path = ROBOTS[name]
    model = load(package(request.config, requirement) / path)
    server = Server(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, server.data, 0)
        mujoco.mj_forward(model, server.data)
    page = studio(server, size=(900, 560))
    page.show()
    picture = page.picture()
    native = Native(model)
    size = picture.shape[1], picture.shape[0]
    expected = native.picture(server.data, size)
    model.geom_rgba[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH] = (0.1, 0.1, 0.1, 0)
    absent = native.picture(server.data, size)
    native.close()
    robot = changed(expected, absent)
    assert robot.mean() > 0.01
    assert similarity(picture, expected) > 0.97
    assert difference(picture, expected) < 2
    assert difference(picture, expected, robot) < 8
