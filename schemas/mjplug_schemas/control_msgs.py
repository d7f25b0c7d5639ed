"""The ROS package control_msgs: states of joints, tolerances, and commands.

Its actions are in `mjplug_schemas.control_msgs_action`, because a message and an action share the name GripperCommand.
"""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.idl import float64, sequence, string, uint16
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


class JointTolerance(Message):
    """How much a joint may differ from its setpoints.

    A tolerance of 0 means the default of the server, and -1 means that nothing is checked.
    """

    name: string = Field("", description="The joint.")
    position: float64 = Field(0.0, description="Tolerance of the position [rad or m].")
    velocity: float64 = Field(0.0, description="Tolerance of the velocity [rad/s or m/s].")
    acceleration: float64 = Field(0.0, description="Tolerance of the acceleration [rad/s² or m/s²].")


class JointComponentTolerance(Message):
    """How much one component of a joint with several degrees of freedom may differ from its setpoints."""

    X_AXIS: ClassVar[uint16] = 1
    Y_AXIS: ClassVar[uint16] = 2
    Z_AXIS: ClassVar[uint16] = 3
    TRANSLATION: ClassVar[uint16] = 4
    ROTATION: ClassVar[uint16] = 5

    joint_name: string = Field("", description="The joint.")
    component: uint16 = Field(0, description="The component, one of the constants.")
    position: float64 = Field(0.0, description="Tolerance of the position [m or rad].")
    velocity: float64 = Field(0.0, description="Tolerance of the velocity [m/s or rad/s].")
    acceleration: float64 = Field(0.0, description="Tolerance of the acceleration [m/s² or rad/s²].")


class GripperCommand(Message):
    """A command for a gripper with one joint."""

    position: float64 = Field(0.0, description="Position of the joint [m or rad].")
    max_effort: float64 = Field(0.0, description="Largest effort; 0 means the largest of the actuator [N or N·m].")
