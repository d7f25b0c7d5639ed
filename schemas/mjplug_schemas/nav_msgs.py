"""The ROS package nav_msgs: pose and velocity of a robot."""

from pydantic import Field

from mjplug_schemas.geometry_msgs import PoseWithCovariance, TwistWithCovariance
from mjplug_schemas.idl import string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class Odometry(Message):
    """An estimate of pose and velocity."""

    header: Header = Field(Header(), description="The time of the estimate, and the frame the pose is in.")
    child_frame_id: string = Field("", description="The frame that moves, in which the twist is expressed.")
    pose: PoseWithCovariance = Field(PoseWithCovariance(), description="The pose in the header's frame [m].")
    twist: TwistWithCovariance = Field(
        TwistWithCovariance(), description="The velocity in the child's frame [m/s, rad/s]."
    )
