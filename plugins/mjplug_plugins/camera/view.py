"""One camera of the model as an image: its size, its frame and its intrinsics."""

import math
from dataclasses import dataclass
from typing import Literal

import mujoco

from mjplug.plugin.bundled import object_names
from mjplug_schemas.sensor_msgs import CameraInfo
from mjplug_schemas.std_msgs import Header

Segmentation = Literal["none", "geom", "body"]
"""What the pixels of a segmentation are numbered by, if there is one."""

_ORTHOGRAPHIC = int(mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC)


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole: lengths in pixels, counted from the top left corner of the image.

    Attributes:
        fx: Focal length in columns.
        fy: Focal length in rows.
        cx: Column of the principal point.
        cy: Row of the principal point.
    """

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True)
class View:
    """What is to be rendered of one camera.

    Attributes:
        name: The camera's name, or what stands for it.
        token: Its name as a part of names of topics and services.
        camera: Its id in the model.
        width: Columns [pixels].
        height: Rows [pixels].
        frame: Frame of its messages.
        intrinsics: None for an orthographic camera, which is no pinhole.
        segmentation: What its pixels are numbered by.
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
        """Returns its CameraInfo. One that is no pinhole has all matrices zero, as ROS says of unknown ones."""
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
    """Returns the cameras' names with their ids; those without a name are called `camera_<id>`."""
    names = object_names(model, mujoco.mjtObj.mjOBJ_CAMERA, "camera", model.ncam)
    return {name: camera for camera, name in enumerate(names)}


def size_of(
    model: mujoco.MjModel, camera: int, own: tuple[int | None, int | None], usual: tuple[int | None, int | None]
) -> tuple[int, int]:
    """Returns how many columns and rows the images of a camera have.

    Each is the first that is given: the camera's own setting, that of all cameras, the camera's `resolution` in the
    model, the size of the model's offscreen buffer (`<visual><global offwidth offheight>`, by default 640x480).

    Args:
        model: The compiled model.
        camera: The camera's id.
        own: Columns and rows that are configured for this camera.
        usual: Columns and rows that are configured for all cameras.
    """
    modelled = model.cam_resolution[camera].tolist()
    if not has_resolution(model, camera):
        modelled = [model.vis.global_.offwidth, model.vis.global_.offheight]
    width, height = (one or all_ or default for one, all_, default in zip(own, usual, modelled, strict=True))
    return int(width), int(height)


def has_resolution(model: mujoco.MjModel, camera: int) -> bool:
    """Returns whether the model gives a camera a `resolution`; MuJoCo's default is one pixel."""
    return bool(model.cam_resolution[camera].tolist() != [1, 1])


def intrinsics_of(model: mujoco.MjModel, camera: int, width: int, height: int) -> Intrinsics | None:
    """Returns how a camera projects to an image of this size [pixels]; None if it is orthographic."""
    if model.cam_projection[camera] == _ORTHOGRAPHIC:
        return None
    sensor_width, sensor_height = model.cam_sensorsize[camera].tolist()
    if not sensor_width or not sensor_height:
        focal = height / 2 / math.tan(math.radians(model.cam_fovy[camera]) / 2)
        return Intrinsics(focal, focal, width / 2, height / 2)
    fx, fy, x, y = model.cam_intrinsic[camera].tolist()
    across, down = width / sensor_width, height / sensor_height
    # MuJoCo's principal point is how far the image is shifted off the axis, to the right and up.
    return Intrinsics(fx * across, fy * down, width / 2 - x * across, height / 2 - y * down)
