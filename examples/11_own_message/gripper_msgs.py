"""The ROS 2 package gripper_msgs: the message and service types of this example.

The name of the module is the name of the ROS package, the names of the classes are the names of the types.
"""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas import registry
from mjplug_schemas.idl import boolean, float64, string, uint8
from mjplug_schemas.message import Message, Service
from mjplug_schemas.std_msgs import Header


class GripperState(Message):
    """The state of a gripper with two fingers."""

    OPEN: ClassVar[uint8] = 0
    CLOSED: ClassVar[uint8] = 1
    BETWEEN: ClassVar[uint8] = 2

    header: Header = Field(Header(), description="The time of the state; no frame is needed.")
    state: uint8 = Field(0, description="OPEN, CLOSED or BETWEEN.")
    opening: float64 = Field(0.0, description="Distance between the fingers [m].")


class MoveGripper(Service):
    """Moves the fingers of a gripper."""

    class Request(Message):
        """The wanted position."""

        opening: float64 = Field(0.0, description="Distance between the fingers [m].")

    class Response(Message):
        """The result, sent when the fingers have moved."""

        success: boolean = Field(False, description="Whether the fingers moved.")
        message: string = Field("", description="The reason if not.")
        reached: GripperState = Field(GripperState(), description="The state after the motion.")


for interface in (GripperState, MoveGripper):
    registry.add(interface)
