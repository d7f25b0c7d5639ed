"""Frames of bodies, sites and cameras."""

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

ZERO_POSITION = np.zeros(3)
IDENTITY_QUAT = np.array((1.0, 0.0, 0.0, 0.0))

OPTICAL_QUAT = np.array((0.0, 1.0, 0.0, 0.0))
"""Rotation from MuJoCo's camera frame (-z forward, y up) to ROS's optical frame (z forward, y down), (w, x, y, z)."""

_RANGE_QUAT = np.array((math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0))
"""Rotation from a site, where a rangefinder measures along z, to the frame of a Range message, along x (w, x, y, z)."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that is fixed to a body or to a camera.

    Attributes:
        name: Its name.
        body: Id of the body that it is fixed to.
        pos: Position in the body frame, or in the optical frame of `camera`, shape (3,) [m].
        quat_wxyz: Orientation in the same frame (w, x, y, z), shape (4,).
        camera: Id of the camera that it is fixed to, if the camera tracks or targets something; else None.
    """

    name: str
    body: int
    pos: Array
    quat_wxyz: Array
    camera: int | None = None

    def coincides_with(self, other: "Frame") -> bool:
        """Returns whether both frames have the same pose on the same body."""
        same_orientation = abs(float(self.quat_wxyz @ other.quat_wxyz)) > 1.0 - 1e-12
        return self.body == other.body and same_orientation and np.allclose(self.pos, other.pos, atol=1e-9)


def camera_frames(model: mujoco.MjModel) -> Iterator[Frame]:
    """Yields the optical frame of each camera, with the frame name that the plugin Camera uses."""
    for camera, name in enumerate(object_names(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", model.ncam)):
        yield _camera(model, f"{name}_frame", camera)


def site_frames(model: mujoco.MjModel, parameters: TransformsParameters) -> Iterator[Frame]:
    """Yields the frames of sites, and for each single rangefinder a frame whose x axis is the ray.

    Raises:
        UnknownName: The model has no site of a configured name.
    """
    if parameters.sites == "none":
        return
    if isinstance(parameters.sites, tuple):
        for name in parameters.sites:
            yield _site(model, name, _id(model, mujoco.mjtObj.mjOBJ_SITE, "site", name, model.nsite))
        return
    sensor_sites: dict[int, None] = {}
    for sensor in range(model.nsensor):
        if int(model.sensor_reftype[sensor]) == _SITE and model.sensor_refid[sensor] >= 0:
            # The values of the sensor are in the axes of this site.
            sensor_sites[int(model.sensor_refid[sensor])] = None
        if int(model.sensor_objtype[sensor]) != _SITE:
            continue
        site, name = int(model.sensor_objid[sensor]), mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor)
        if int(model.sensor_type[sensor]) != _RANGEFINDER:
            sensor_sites[site] = None
        elif name and not _RAY_NAME.fullmatch(name):
            frame = _site(model, f"{name}_frame", site)
            yield Frame(frame.name, frame.body, frame.pos, compose(frame.quat_wxyz, _RANGE_QUAT))
    for site in range(model.nsite) if parameters.sites == "all" else sensor_sites:
        if name := mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, site):
            yield _site(model, name, site)


def configured_frame(model: mujoco.MjModel, name: str, settings: FrameParameters) -> Frame:
    """Returns a configured frame.

    Raises:
        UnknownName: The model has no body, site or camera of that name.
    """
    if settings.body is not None:
        base = Frame(
            name, _id(model, mujoco.mjtObj.mjOBJ_BODY, "body", settings.body, model.nbody), ZERO_POSITION, IDENTITY_QUAT
        )
    elif settings.site is not None:
        base = _site(model, name, _id(model, mujoco.mjtObj.mjOBJ_SITE, "site", settings.site, model.nsite))
    else:
        camera = _id(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", settings.camera or "", model.ncam)
        base = _camera(model, name, camera)
    turn, shift = np.empty(4), np.empty(3)
    mujoco.mju_euler2Quat(turn, np.array(settings.rpy), "XYZ")
    mujoco.mju_rotVecQuat(shift, np.array(settings.xyz), base.quat_wxyz)
    return Frame(name, base.body, base.pos + shift, compose(base.quat_wxyz, turn), base.camera)


def compose(quat_a: Array, quat_b: Array) -> Array:
    """Returns the rotation product `quat_a` · `quat_b`, all (w, x, y, z), shape (4,)."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, quat_a, quat_b)
    return product


def _camera(model: mujoco.MjModel, name: str, camera: int) -> Frame:
    if int(model.cam_mode[camera]) != _FIXED:
        return Frame(name, 0, ZERO_POSITION, IDENTITY_QUAT, camera)
    quat = compose(model.cam_quat[camera], OPTICAL_QUAT)
    return Frame(name, int(model.cam_bodyid[camera]), model.cam_pos[camera].copy(), quat)


def _site(model: mujoco.MjModel, name: str, site: int) -> Frame:
    return Frame(name, int(model.site_bodyid[site]), model.site_pos[site].copy(), model.site_quat[site].copy())


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, word: str, name: str, count: int) -> int:
    names = [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]
    if not name or name not in names:
        raise UnknownName(word, name, names)
    return names.index(name)
