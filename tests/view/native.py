"""Pictures by MuJoCo's own renderer, to compare those of the page with, and measures of how equal they are."""

import os
from unittest import mock

import cv2
import mujoco
import numpy as np

from mjplug.plugin import UnavailableError
from mjplug_plugins.camera.gl import GlContext, environments

_FLAG, _RENDER = mujoco.mjtVisFlag, mujoco.mjtRndFlag
_MAX_GEOMS = 20_000
_LARGEST = (800, 600)


def free_camera(model):
    """Returns the camera with which MuJoCo's viewers start."""
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    return camera


def fixed_camera(model, name):
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(name).id
    return camera


def options(**flags):
    """Returns visualisation options that draw what the page draws without overlays, and the given kinds."""
    option = mujoco.MjvOption()
    for flag in ("TENDON", "RANGEFINDER", "ACTUATOR"):
        option.flags[getattr(_FLAG, f"mjVIS_{flag}")] = 0
    for flag, value in flags.items():
        option.flags[getattr(_FLAG, f"mjVIS_{flag}")] = value
    return option


class Native:
    """MuJoCo's renderer for one model, without reflections."""

    def __init__(self, model):
        self.model = model
        model.vis.global_.offwidth, model.vis.global_.offheight = _LARGEST
        self._gl = _context()
        self._scene = mujoco.MjvScene(model, _MAX_GEOMS)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)

    def close(self):
        self._context.free()
        self._gl.close()

    def picture(self, data, size, camera=None, option=None, shadows=False):
        """Returns a picture, shape (height, width, 3), RGB; size is (width, height)."""
        camera, option = camera or free_camera(self.model), option or options()
        mujoco.mjv_updateScene(self.model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene)
        self._scene.flags[_RENDER.mjRND_SHADOW] = shadows
        self._scene.flags[_RENDER.mjRND_REFLECTION] = 0
        self._gl.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        viewport = mujoco.MjrRect(0, 0, *size)
        mujoco.mjr_render(viewport, self._scene, self._context)
        pixels = np.empty((size[1], size[0], 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, viewport, self._context)
        return pixels[::-1].copy()


def _context():
    error = None
    for environment in environments():
        with mock.patch.dict(os.environ, environment):
            try:
                return GlContext(*_LARGEST)
            except UnavailableError as caught:
                error = caught
    raise error


def difference(a, b, mask=None):
    """Returns the mean absolute difference of the pixels, 0 to 255."""
    values = np.abs(a.astype(np.int16) - b).mean(axis=2)
    return float(values.mean() if mask is None else values[mask].mean())


def similarity(a, b, scale=4):
    """Returns the structural similarity (SSIM) of two pictures that are made smaller, 1 for equal ones."""
    size = a.shape[1] // scale, a.shape[0] // scale
    x, y = (
        cv2.cvtColor(cv2.resize(p, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY).astype(float)
        for p in (a, b)
    )

    def mean(values):
        return cv2.GaussianBlur(values, (7, 7), 1.5)

    mx, my = mean(x), mean(y)
    vx, vy, vxy = mean(x * x) - mx * mx, mean(y * y) - my * my, mean(x * y) - mx * my
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    ssim = (2 * mx * my + c1) * (2 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    return float(ssim.mean())


def changed(a, b, threshold=12):
    """Returns where two pictures differ clearly, without the antialiased border; shape (height, width)."""
    mask = (np.abs(a.astype(np.int16) - b).max(axis=2) > threshold).astype(np.uint8)
    return cv2.erode(mask, np.ones((3, 3), np.uint8)).astype(bool)
