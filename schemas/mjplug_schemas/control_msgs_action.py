"""The actions of the ROS package control_msgs: motions of joints, and commands for grippers."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas import control_msgs
from mjplug_schemas.action import Action
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.control_msgs import JointComponentTolerance, JointTolerance
from mjplug_schemas.idl import boolean, float64, int32, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.trajectory_msgs import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)


class FollowJointTrajectory(Action, package="control_msgs"):
    """Moves joints along a trajectory, within tolerances.

    The definition is that of Humble and Jazzy. In later distributions, the feedback also contains the index of the
    point.
    """

    class Goal(Message):
        """The trajectory and its tolerances."""

        trajectory: JointTrajectory = Field(JointTrajectory(), description="The motion of hinges and slides.")
        multi_dof_trajectory: MultiDOFJointTrajectory = Field(
            MultiDOFJointTrajectory(), description="The motion of joints with several degrees of freedom."
        )
        path_tolerance: sequence[JointTolerance] = Field(
            (), description="Tolerances during the motion; the goal is aborted if a joint exceeds one."
        )
        component_path_tolerance: sequence[JointComponentTolerance] = Field(
            (), description="Tolerances during the motion of joints with several degrees of freedom."
        )
        goal_tolerance: sequence[JointTolerance] = Field(
            (), description="Tolerances at the last point; the goal succeeds when all joints meet theirs."
        )
        component_goal_tolerance: sequence[JointComponentTolerance] = Field(
            (), description="Tolerances at the last point of joints with several degrees of freedom."
        )
        goal_time_tolerance: Duration = Field(
            Duration(), description="How much later than its last point the goal may succeed [s, ns]."
        )

    class Result(Message):
        """Whether the motion succeeded."""

        SUCCESSFUL: ClassVar[int32] = 0
        INVALID_GOAL: ClassVar[int32] = -1
        INVALID_JOINTS: ClassVar[int32] = -2
        OLD_HEADER_TIMESTAMP: ClassVar[int32] = -3
        PATH_TOLERANCE_VIOLATED: ClassVar[int32] = -4
        GOAL_TOLERANCE_VIOLATED: ClassVar[int32] = -5

        error_code: int32 = Field(0, description="Zero, or what went wrong, one of the constants.")
        error_string: string = Field("", description="The result as text.")

    class Feedback(Message):
        """Where the joints should be, and where they are."""

        header: Header = Field(Header(), description="Simulated time of the state; no frame.")
        joint_names: sequence[string] = Field((), description="The joints, in the order of the numbers of each point.")
        desired: JointTrajectoryPoint = Field(JointTrajectoryPoint(), description="The setpoints.")
        actual: JointTrajectoryPoint = Field(JointTrajectoryPoint(), description="The state.")
        error: JointTrajectoryPoint = Field(JointTrajectoryPoint(), description="The setpoints minus the state.")
        multi_dof_joint_names: sequence[string] = Field((), description="Joints with several degrees of freedom.")
        multi_dof_desired: MultiDOFJointTrajectoryPoint = Field(
            MultiDOFJointTrajectoryPoint(), description="Their setpoints."
        )
        multi_dof_actual: MultiDOFJointTrajectoryPoint = Field(
            MultiDOFJointTrajectoryPoint(), description="Their state."
        )
        multi_dof_error: MultiDOFJointTrajectoryPoint = Field(
            MultiDOFJointTrajectoryPoint(), description="Their setpoints minus their state."
        )


class GripperCommand(Action, package="control_msgs"):
    """Moves a gripper with one joint."""

    class Goal(Message):
        """Where to move the gripper."""

        command: control_msgs.GripperCommand = Field(
            control_msgs.GripperCommand(), description="Position and largest effort."
        )

    class Result(Message):
        """Where the gripper has stopped."""

        position: float64 = Field(0.0, description="Position of the joint [m or rad].")
        effort: float64 = Field(0.0, description="Effort of the actuator [N or N·m].")
        stalled: boolean = Field(False, description="Whether something stops the gripper.")
        reached_goal: boolean = Field(False, description="Whether the gripper has reached the commanded position.")

    class Feedback(Message):
        """Where the gripper is."""

        position: float64 = Field(0.0, description="Position of the joint [m or rad].")
        effort: float64 = Field(0.0, description="Effort of the actuator [N or N·m].")
        stalled: boolean = Field(False, description="Whether something stops the gripper.")
        reached_goal: boolean = Field(False, description="Whether the gripper has reached the commanded position.")


class ParallelGripperCommand(Action, package="control_msgs"):
    """Moves a gripper whose fingers move in parallel."""

    class Goal(Message):
        """Where to move the gripper."""

        command: JointState = Field(
            JointState(),
            description="Joint and position; optionally its largest velocity and its largest effort.",
        )

    class Result(Message):
        """Where the gripper has stopped."""

        state: JointState = Field(JointState(), description="Position, velocity and effort of the joint.")
        stalled: boolean = Field(False, description="Whether something stops the gripper.")
        reached_goal: boolean = Field(False, description="Whether the gripper has reached the commanded position.")

    class Feedback(Message):
        """Where the gripper is."""

        state: JointState = Field(JointState(), description="Position, velocity and effort of the joint.")
