"""The ROS package sensor_msgs: what sensors and joints report."""

from pydantic import Field

from mjplug_schemas.idl import float32, float64, sequence, string, uint8_sequence
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
    format: string = Field("", description="How the data is compressed, such as `jpeg` or `png`.")
    data: uint8_sequence = Field(b"", description="The compressed image.")


class LaserScan(Message):
    """Distances in a plane, measured one after the other while the beam turns."""

    header: Header = Field(
        Header(), description="The time of the first ray, and the frame whose z axis the beam turns about."
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
    intensities: sequence[float32] = Field((), description="How strong each return was; empty if it is not known.")
