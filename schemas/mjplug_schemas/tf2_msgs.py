"""The ROS package tf2_msgs: the transforms between coordinate frames."""

from pydantic import Field

from mjplug_schemas.geometry_msgs import TransformStamped
from mjplug_schemas.idl import sequence
from mjplug_schemas.message import Message


class TFMessage(Message):
    """Several transforms at once, as on `/tf` and `/tf_static`."""

    transforms: sequence[TransformStamped] = Field((), description="The transforms, each from a parent to a child.")
