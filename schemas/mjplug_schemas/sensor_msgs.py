"""The ROS package sensor_msgs: measurements of sensors and states of joints."""

from typing import Annotated, ClassVar

from pydantic import Field

from mjplug_schemas.geometry_msgs import Quaternion, Vector3
from mjplug_schemas.idl import (
    Exactly,
    boolean,
    float32,
    float64,
    sequence,
    string,
    uint8,
    uint8_sequence,
    uint32,
)
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class JointState(Message):
    """The state of joints; each of the three lists of numbers is empty or as long as `name`."""

    header: Header = Field(Header(), description="The time of the state; no frame is needed.")
    name: sequence[string] = Field((), description="The joints, in the order of the other lists.")
    position: sequence[float64] = Field((), description="Positions [rad or m].")
    velocity: sequence[float64] = Field((), description="Velocities [rad/s or m/s].")
    effort: sequence[float64] = Field((), description="Efforts [N·m or N].")


class CompressedImage(Message):
    """An image in a compressed file format."""

    header: Header = Field(Header(), description="The time of the image, and the camera's optical frame.")
    format: string = Field("", description="Format of the data, such as `jpeg` or `png`.")
    data: uint8_sequence = Field(b"", description="The compressed image.")


class LaserScan(Message):
    """Distances in a plane, measured in turn while the beam rotates."""

    header: Header = Field(
        Header(), description="The time of the first ray, and the frame whose z axis the beam rotates about."
    )
    angle_min: float32 = Field(0.0, description="The angle of the first ray, from the x axis towards y [rad].")
    angle_max: float32 = Field(0.0, description="The angle of the last ray [rad].")
    angle_increment: float32 = Field(0.0, description="The angle from one ray to the next [rad].")
    time_increment: float32 = Field(0.0, description="The time from one ray to the next [s].")
    scan_time: float32 = Field(0.0, description="The time from one scan to the next [s].")
    range_min: float32 = Field(0.0, description="The smallest distance that can be measured [m].")
    range_max: float32 = Field(0.0, description="The largest distance that can be measured [m].")
    ranges: sequence[float32] = Field(
        (), description="The distances; +infinity is nothing in range, -infinity is too close, NaN is an error [m]."
    )
    intensities: sequence[float32] = Field((), description="Intensity of each return; empty if unknown.")


class Image(Message):
    """An uncompressed image."""

    header: Header = Field(
        Header(),
        description="The time the image was taken, and the camera's optical frame: x right, y down, z into the scene.",
    )
    height: uint32 = Field(0, description="How many rows it has [pixels].")
    width: uint32 = Field(0, description="How many columns it has [pixels].")
    encoding: string = Field("", description="Pixel format, such as `rgb8`, `mono8`, `16UC1` or `32FC1`.")
    is_bigendian: uint8 = Field(0, description="1 if the bytes of a channel are big endian, 0 if little endian.")
    step: uint32 = Field(0, description="The length of one row [bytes].")
    data: uint8_sequence = Field(b"", description="The pixels, row by row from the top; `step` * `height` bytes.")


class RegionOfInterest(Message):
    """A rectangle of an image."""

    x_offset: uint32 = Field(0, description="Its leftmost column; 0 is the left edge of the image [pixels].")
    y_offset: uint32 = Field(0, description="Its topmost row; 0 is the top edge of the image [pixels].")
    height: uint32 = Field(0, description="How many rows it has [pixels].")
    width: uint32 = Field(0, description="How many columns it has [pixels].")
    do_rectify: boolean = Field(
        False, description="Whether the rectangle must be recomputed for the rectified image; false for a full image."
    )


class CameraInfo(Message):
    """Intrinsics of a camera; all zeros mean that the camera is not calibrated."""

    header: Header = Field(Header(), description="Time and frame of the corresponding image.")
    height: uint32 = Field(0, description="How many rows the image has at calibration [pixels].")
    width: uint32 = Field(0, description="How many columns the image has at calibration [pixels].")
    distortion_model: string = Field("", description="The model that `d` belongs to, such as `plumb_bob`.")
    d: sequence[float64] = Field((), description="The distortion parameters; five for `plumb_bob`: k1, k2, t1, t2, k3.")
    k: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 matrix, row by row, of fx, 0, cx; 0, fy, cy; 0, 0, 1, unrectified [pixels]."
    )
    r: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 rotation, row by row, that rectifies; the identity for one camera."
    )
    p: Annotated[sequence[float64], Exactly(12)] = Field(
        (0.0,) * 12,
        description="The 3x4 projection, row by row, of points in the camera's frame to rectified pixels [pixels].",
    )
    binning_x: uint32 = Field(0, description="How many columns the sensor joins into one; 0 is as 1.")
    binning_y: uint32 = Field(0, description="How many rows the sensor joins into one; 0 is as 1.")
    roi: RegionOfInterest = Field(
        RegionOfInterest(), description="The part of the sensor that is sent, before binning; all zeros is all of it."
    )


class PointField(Message):
    """One field of the points of a cloud: its offset in the bytes of a point, and its type."""

    INT8: ClassVar[uint8] = 1
    UINT8: ClassVar[uint8] = 2
    INT16: ClassVar[uint8] = 3
    UINT16: ClassVar[uint8] = 4
    INT32: ClassVar[uint8] = 5
    UINT32: ClassVar[uint8] = 6
    FLOAT32: ClassVar[uint8] = 7
    FLOAT64: ClassVar[uint8] = 8

    name: string = Field("", description="What it is, such as `x`, `y`, `z`, `intensity` or `rgb`.")
    offset: uint32 = Field(0, description="How far into the point it starts [bytes].")
    datatype: uint8 = Field(0, description="Its type, one of INT8 to FLOAT64.")
    count: uint32 = Field(0, description="How many of the type it has.")


class PointCloud2(Message):
    """Points in space with any fields, packed as bytes."""

    header: Header = Field(Header(), description="The time of the points and the frame they are in.")
    height: uint32 = Field(0, description="How many rows the points have; 1 for points in no order.")
    width: uint32 = Field(0, description="How many points a row has.")
    fields: sequence[PointField] = Field((), description="The values each point has.")
    is_bigendian: boolean = Field(False, description="Whether the values are big endian.")
    point_step: uint32 = Field(0, description="The length of one point [bytes].")
    row_step: uint32 = Field(0, description="The length of one row [bytes].")
    data: uint8_sequence = Field(b"", description="The points, row by row; `row_step` * `height` bytes.")
    is_dense: boolean = Field(False, description="Whether all points are valid; if false, some may be NaN.")


class Imu(Message):
    """Measurement of an IMU; if the first element of a covariance is -1, that quantity is not measured."""

    header: Header = Field(Header(), description="The time of the measurement and the sensor's frame.")
    orientation: Quaternion = Field(Quaternion(), description="Orientation of the sensor in the world.")
    orientation_covariance: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 covariance, row by row, of rotations about x, y, z; zeros if unknown [rad²]."
    )
    angular_velocity: Vector3 = Field(Vector3(), description="Angular velocity in the sensor's frame [rad/s].")
    angular_velocity_covariance: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 covariance, row by row, over x, y, z; zeros if unknown [(rad/s)²]."
    )
    linear_acceleration: Vector3 = Field(
        Vector3(), description="Acceleration in the sensor's frame, gravity's reaction included [m/s²]."
    )
    linear_acceleration_covariance: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 covariance, row by row, over x, y, z; zeros if unknown [(m/s²)²]."
    )


class MagneticField(Message):
    """Measurement of a magnetometer."""

    header: Header = Field(Header(), description="The time of the measurement and the sensor's frame.")
    magnetic_field: Vector3 = Field(Vector3(), description="The field in the sensor's frame; NaN is not measured [T].")
    magnetic_field_covariance: Annotated[sequence[float64], Exactly(9)] = Field(
        (0.0,) * 9, description="The 3x3 covariance, row by row, over x, y, z; zeros if unknown [T²]."
    )


class Range(Message):
    """One distance along one direction, within a cone."""

    ULTRASOUND: ClassVar[uint8] = 0
    INFRARED: ClassVar[uint8] = 1

    header: Header = Field(Header(), description="The time of the measurement, and the frame whose x axis it is along.")
    radiation_type: uint8 = Field(0, description="What the sensor sends out: ULTRASOUND or INFRARED.")
    field_of_view: float32 = Field(0.0, description="The opening angle of the cone [rad].")
    min_range: float32 = Field(0.0, description="The smallest distance that can be measured [m].")
    max_range: float32 = Field(0.0, description="The largest distance that can be measured [m].")
    range: float32 = Field(
        0.0, description="The distance; +infinity is nothing in range, -infinity is too close, NaN is an error [m]."
    )
    variance: float32 = Field(0.0, description="The variance of the distance; 0 is unknown [m²].")
