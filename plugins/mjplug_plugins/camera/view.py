"""The image of one camera of the model: size, frame and intrinsics."""

import math
from dataclasses import dataclass
from typing import Literal

import mujoco

from mjplug.plugin.bundled import object_names
from mjplug_schemas.sensor_msgs import CameraInfo
from mjplug_schemas.std_msgs import Header

Segmentation = Literal["none", "geom", "body"]
"""Ids in a segmentation image; `none`: no segmentation image."""

_ORTHOGRAPHIC = int(mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC)


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera; lengths in pixels from the top left corner of the image.

    Attributes:
        fx: Horizontal focal length [pixels].
        fy: Vertical focal length [pixels].
        cx: Column of the principal point [pixels].
        cy: Row of the principal point [pixels].
    """

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True)
class View:
    """What is rendered for one camera.

    Attributes:
        name: Name of the camera, or `camera_<id>`.
        token: Its name as a part of topic and service names.
        camera: Its id in the model.
        width: Width of the images [pixels].
        height: Height of the images [pixels].
        frame: Frame of the messages.
        intrinsics: None for an orthographic camera.
        segmentation: Ids in the segmentation image.
    """

    name: str
    token: str
    camera: int
    width: int
    height: int
    frame: str
    intrinsics: Intrinsics | None
    segmentation: Segmentation

    def info(self) -> CameraInfo:
        """Returns the CameraInfo. For an orthographic camera all matrices are zero, which means unknown in ROS."""
        header = Header(frame_id=self.frame)
        if self.intrinsics is None:
            return CameraInfo(header=header, width=self.width, height=self.height)
        pinhole = self.intrinsics
        return CameraInfo(
            header=header,
            width=self.width,
            height=self.height,
            distortion_model="plumb_bob",
            d=(0.0,) * 5,
            k=(pinhole.fx, 0.0, pinhole.cx, 0.0, pinhole.fy, pinhole.cy, 0.0, 0.0, 1.0),
            r=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            p=(pinhole.fx, 0.0, pinhole.cx, 0.0, 0.0, pinhole.fy, pinhole.cy, 0.0, 0.0, 0.0, 1.0, 0.0),
        )


def camera_names(model: mujoco.MjModel) -> dict[str, int]:
    """Returns the ids of the cameras by name; a camera without a name is called `camera_<id>`."""
    names = object_names(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", model.ncam)
    return {name: camera for camera, name in enumerate(names)}


def size_of(
    model: mujoco.MjModel, camera: int, own: tuple[int | None, int | None], common: tuple[int | None, int | None]
) -> tuple[int, int]:
    """Returns width and height of a camera's images [pixels].

    Each value is the first that is set of: the parameter of the camera, the parameter of the plugin, the camera's
    `resolution` in the model, the size of the model's offscreen buffer (`<visual><global offwidth offheight>`, default
    640x480).

    Args:
        model: The compiled model.
        camera: The camera's id.
        own: Width and height that are configured for this camera [pixels].
        common: Width and height that are configured for all cameras [pixels].
    """
    modelled = model.cam_resolution[camera].tolist()
    if not has_resolution(model, camera):
        modelled = [model.vis.global_.offwidth, model.vis.global_.offheight]
    width, height = (one or all_ or default for one, all_, default in zip(own, common, modelled, strict=True))
    return int(width), int(height)


def has_resolution(model: mujoco.MjModel, camera: int) -> bool:
    """Returns whether the model sets the `resolution` of a camera; MuJoCo's default is one pixel."""
    return bool(model.cam_resolution[camera].tolist() != [1, 1])


def intrinsics_of(model: mujoco.MjModel, camera: int, width: int, height: int) -> Intrinsics | None:
    """Returns the intrinsics of a camera for this image size [pixels]; None if it is orthographic."""
    if model.cam_projection[camera] == _ORTHOGRAPHIC:
        return None
    sensor_width, sensor_height = model.cam_sensorsize[camera].tolist()
    if not sensor_width or not sensor_height:
        focal = height / 2 / math.tan(math.radians(model.cam_fovy[camera]) / 2)
        return Intrinsics(focal, focal, width / 2, height / 2)
    fx, fy, x, y = model.cam_intrinsic[camera].tolist()
    across, down = width / sensor_width, height / sensor_height
    # MuJoCo's principal point is the offset of the image from the optical axis, to the right and up.
    return Intrinsics(fx * across, fy * down, width / 2 - x * across, height / 2 - y * down)
