"""The ROS package control_msgs: the part of it that reports any interfaces of joints."""

from pydantic import Field

from mjplug_schemas.idl import float64, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class InterfaceValue(Message):
    """The values of several interfaces of one joint."""

    interface_names: sequence[string] = Field((), description="The interfaces, such as `position` or `effort`.")
    values: sequence[float64] = Field((), description="The value of each, in SI units.")


class DynamicJointState(Message):
    """The state of joints that do not all have the same interfaces."""

    header: Header = Field(Header(), description="The time of the state; no frame is needed.")
    joint_names: sequence[string] = Field((), description="The joints.")
    interface_values: sequence[InterfaceValue] = Field((), description="The interfaces of each joint, in that order.")
