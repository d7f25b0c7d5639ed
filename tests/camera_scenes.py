"""Scenes for cameras, and what must be seen in them by the rules of projection alone."""

import textwrap

import mujoco
import numpy as np
import pytest
from machine import lacking

from mjplug.errors import MjplugError
from mjplug.plugin import UnavailableError
from mjplug.testing import World
from mjplug_plugins.camera import Camera
from mjplug_plugins.camera.gl import BACKEND_VARIABLE, GlContext

DT = 0.002

FOVY = 'resolution="64 48" fovy="70"'
SKEW = 'resolution="80 60" sensorsize="0.02 0.012" focalpixel="55 70" principalpixel="9 -5"'
"""Different focal lengths across and down, and the principal point off the centre."""

NARROW = 'resolution="50 90" fovy="40"'

TILTED = 'pos="0.3 -0.2 2" euler="35 20 10"'
DOWN = 'pos="0.3 -0.2 2"'


def scene(cameras='<camera name="eye" pos="0 0 2" resolution="64 48"/>', things="", visual="", extent=1.0):
    return textwrap.dedent(f"""
    <mujoco>
      <option timestep="{DT}" gravity="0 0 0"/>
      <statistic extent="{extent}" center="0 0 0"/>
      <visual><map znear="0.02" zfar="100"/><quality shadowsize="512"/>{visual}</visual>
      <asset><texture name="sky" type="skybox" builtin="flat" rgb1=".2 .3 .4" width="16" height="96"/></asset>
      <worldbody><light pos="0 0 5"/>{cameras}{things}</worldbody>
    </mujoco>
    """)


FLOOR = '<geom name="floor" type="plane" size="50 50 1"/>'


_worlds = []


def world_of(xml, name="cameras", **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    _worlds.append(world)
    world.add(Camera, name, **parameters)
    return world


@pytest.fixture(autouse=True)
def closing(gl):
    """Closes the OpenGL contexts of a test: one that is collected later takes the current one with it."""
    yield
    while _worlds:
        _worlds.pop().workers.close()


def seen(xml, camera="eye", **parameters):
    """Returns the colour, depth and info messages of a camera at t = 0.2 s, and the world."""
    world = world_of(xml, **parameters)
    world.loop.step(100)
    messages = [world.published(f"/cameras/{camera}/{topic}")[-1] for topic in ("color", "depth", "camera_info")]
    return *messages, world


def pixels(image):
    dtype, channels = {"rgb8": ("u1", 3), "32FC1": ("<f4", 1), "32SC1": ("<i4", 1)}[image.encoding]
    assert image.step == image.width * channels * np.dtype(dtype).itemsize
    shape = (image.height, image.width, 3) if channels == 3 else (image.height, image.width)
    return np.frombuffer(bytes(image.data), dtype).reshape(shape)


def refusal(xml, **parameters):
    with pytest.raises(MjplugError) as caught:
        world_of(xml, **parameters)
    return str(caught.value)


def pose(world, camera="eye"):
    """Returns where a camera is, and its optical axes (right, down, forward) as columns."""
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_forward(world.model, data)
    camera_id = world.model.camera(camera).id
    return data.cam_xpos[camera_id].copy(), data.cam_xmat[camera_id].reshape(3, 3) * (1, -1, -1)


def plane_depth(info, position, axes):
    """Returns how far along the optical axis the plane z = 0 is in each pixel; not positive where it is not met."""
    k = np.array(info.k).reshape(3, 3)
    v, u = np.mgrid[0 : info.height, 0 : info.width] + 0.5
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1) @ axes.T
    with np.errstate(divide="ignore"):
        return -position[2] / rays[..., 2]


def projected(info, position, axes, points):
    """Returns the columns and rows at which points of the world appear, by P."""
    in_camera = (np.asarray(points) - position) @ axes
    homogeneous = np.c_[in_camera, np.ones(len(in_camera))] @ np.array(info.p).reshape(3, 4).T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def need_opengl():
    """Returns the OpenGL backend that works on this machine; skips the running test where none does."""
    reasons = []
    for backend in ("egl", "osmesa"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(BACKEND_VARIABLE, backend)
            patch.setenv("PYOPENGL_PLATFORM", backend)
            try:
                GlContext(16, 16).close()
            except UnavailableError as error:
                reasons.append(str(error))
            else:
                return backend
    return lacking("; ".join(reasons))


@pytest.fixture(scope="module")
def gl():
    """OpenGL in this process, with any backend that works."""
    backend = need_opengl()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(BACKEND_VARIABLE, backend)
        patch.setenv("PYOPENGL_PLATFORM", backend)
        yield backend
