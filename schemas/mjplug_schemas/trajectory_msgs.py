"""The ROS package trajectory_msgs: motions of joints over time."""

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Transform, Twist
from mjplug_schemas.idl import float64, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class JointTrajectoryPoint(Message):
    """Setpoints of joints at one time; each list is empty or has one number for each joint of the trajectory."""

    positions: sequence[float64] = Field((), description="Positions [rad or m].")
    velocities: sequence[float64] = Field((), description="Velocities [rad/s or m/s].")
    accelerations: sequence[float64] = Field((), description="Accelerations [rad/s² or m/s²].")
    effort: sequence[float64] = Field((), description="Efforts [N·m or N].")
    time_from_start: Duration = Field(Duration(), description="Time since the start of the trajectory [s, ns].")


class JointTrajectory(Message):
    """A motion of joints with one degree of freedom each."""

    header: Header = Field(Header(), description="When the motion starts; a zero stamp is at once.")
    joint_names: sequence[string] = Field((), description="The joints, in the order of the numbers of each point.")
    points: sequence[JointTrajectoryPoint] = Field((), description="The points, in the order of their times.")


class MultiDOFJointTrajectoryPoint(Message):
    """Setpoints of joints with several degrees of freedom at one time, one entry for each joint."""

    transforms: sequence[Transform] = Field((), description="Poses, in the frame that the header names [m].")
    velocities: sequence[Twist] = Field((), description="Velocities [m/s, rad/s].")
    accelerations: sequence[Twist] = Field((), description="Accelerations [m/s², rad/s²].")
    time_from_start: Duration = Field(Duration(), description="Time since the start of the trajectory [s, ns].")


class MultiDOFJointTrajectory(Message):
    """A motion of joints with several degrees of freedom each."""

    header: Header = Field(Header(), description="When the motion starts, and the frame of its poses.")
    joint_names: sequence[string] = Field((), description="The joints, in the order of the entries of each point.")
    points: sequence[MultiDOFJointTrajectoryPoint] = Field((), description="The points, in the order of their times.")
