"""The ROS package sensor_msgs: what sensors and joints report."""

from pydantic import Field

from mjplug_schemas.idl import float64, sequence, string, uint8_sequence
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
