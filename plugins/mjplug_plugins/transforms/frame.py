"""Frames: names for places on bodies."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import UnknownName
from mjplug.plugin.bundled import object_names
from mjplug_plugins.transforms.parameters import FrameParameters, TransformsParameters

Array = NDArray[np.float64]

_FIXED = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
_RANGEFINDER = int(mujoco.mjtSensor.mjSENS_RANGEFINDER)
_RAY_NAME = re.compile(r".+-\d+", re.ASCII)

HERE = np.zeros(3)
UNTURNED = np.array((1.0, 0.0, 0.0, 0.0))

OPTICAL = np.array((0.0, 1.0, 0.0, 0.0))
"""From MuJoCo's camera, which looks along -z with y up, to ROS's optical frame, which looks along z with y down."""

_ALONG_X = np.array((math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0))
"""From a site, along whose z a rangefinder looks, to the frame of a Range, which looks along x."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame.

    Attributes:
        name: Its name.
        body: The id of the body that it is fixed to.
        pos: Where it is in the body's frame [m], shape (3,); with a camera, in that one's optical frame.
        quat_wxyz: How it is turned there, shape (4,).
        camera: The id of the camera that it goes with, if that moves by itself instead of with its body.
    """

    name: str
    body: int
    pos: Array
    quat_wxyz: Array
    camera: int | None = None

    def is_at(self, other: "Frame") -> bool:
        """Whether both are the same place."""
        same_turn = abs(float(self.quat_wxyz @ other.quat_wxyz)) > 1.0 - 1e-12
        return self.body == other.body and same_turn and np.allclose(self.pos, other.pos, atol=1e-9)


def camera_frames(model: mujoco.MjModel) -> Iterator[Frame]:
    """Yields the optical frame of each camera, called as the plugin Camera calls it."""
    for camera, name in enumerate(object_names(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", model.ncam)):
        yield _camera(model, f"{name}_frame", camera)


def site_frames(model: mujoco.MjModel, wanted: TransformsParameters) -> Iterator[Frame]:
    """Yields the frames of sites, and for each single rangefinder one that looks along its x axis.

    Raises:
        UnknownName: A site that is asked for does not exist.
    """
    if wanted.sites == "none":
        return
    if isinstance(wanted.sites, tuple):
        for name in wanted.sites:
            yield _site(model, name, _id(model, mujoco.mjtObj.mjOBJ_SITE, "site", name, model.nsite))
        return
    sensed: dict[int, None] = {}
    for sensor in range(model.nsensor):
        if int(model.sensor_reftype[sensor]) == _SITE and model.sensor_refid[sensor] >= 0:
            # In whose axes the numbers are.
            sensed[int(model.sensor_refid[sensor])] = None
        if int(model.sensor_objtype[sensor]) != _SITE:
            continue
        site, name = int(model.sensor_objid[sensor]), mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor)
        if int(model.sensor_type[sensor]) != _RANGEFINDER:
            sensed[site] = None
        elif name and not _RAY_NAME.fullmatch(name):
            frame = _site(model, f"{name}_frame", site)
            yield Frame(frame.name, frame.body, frame.pos, compose(frame.quat_wxyz, _ALONG_X))
    for site in range(model.nsite) if wanted.sites == "all" else sensed:
        if name := mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, site):
            yield _site(model, name, site)


def given_frame(model: mujoco.MjModel, name: str, given: FrameParameters) -> Frame:
    """Returns a frame that is configured.

    Raises:
        UnknownName: What it is fixed to does not exist.
    """
    if given.body is not None:
        base = Frame(name, _id(model, mujoco.mjtObj.mjOBJ_BODY, "body", given.body, model.nbody), HERE, UNTURNED)
    elif given.site is not None:
        base = _site(model, name, _id(model, mujoco.mjtObj.mjOBJ_SITE, "site", given.site, model.nsite))
    else:
        camera = _id(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", given.camera or "", model.ncam)
        base = _camera(model, name, camera)
    turn, shift = np.empty(4), np.empty(3)
    mujoco.mju_euler2Quat(turn, np.array(given.rpy), "XYZ")
    mujoco.mju_rotVecQuat(shift, np.array(given.xyz), base.quat_wxyz)
    return Frame(name, base.body, base.pos + shift, compose(base.quat_wxyz, turn), base.camera)


def compose(quat_a: Array, quat_b: Array) -> Array:
    """Returns the turn `quat_b` within the frame that `quat_a` turns, both (w, x, y, z)."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, quat_a, quat_b)
    return product


def _camera(model: mujoco.MjModel, name: str, camera: int) -> Frame:
    if int(model.cam_mode[camera]) != _FIXED:
        return Frame(name, 0, HERE, UNTURNED, camera)
    quat = compose(model.cam_quat[camera], OPTICAL)
    return Frame(name, int(model.cam_bodyid[camera]), model.cam_pos[camera].copy(), quat)


def _site(model: mujoco.MjModel, name: str, site: int) -> Frame:
    return Frame(name, int(model.site_bodyid[site]), model.site_pos[site].copy(), model.site_quat[site].copy())


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, word: str, name: str, count: int) -> int:
    names = [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]
    if not name or name not in names:
        raise UnknownName(word, name, names)
    return names.index(name)
