"""The ROS package action_msgs: state and cancellation of goals of actions."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.idl import int8, sequence
from mjplug_schemas.message import Message, Service
from mjplug_schemas.unique_identifier_msgs import UUID


class GoalInfo(Message):
    """A goal, and when the server accepted it."""

    goal_id: UUID = Field(UUID(), description="Identifier of the goal, chosen by its client.")
    stamp: Time = Field(Time(), description="Simulated time at which the server accepted the goal [s, ns].")


class GoalStatus(Message):
    """The state of a goal."""

    STATUS_UNKNOWN: ClassVar[int8] = 0
    STATUS_ACCEPTED: ClassVar[int8] = 1
    STATUS_EXECUTING: ClassVar[int8] = 2
    STATUS_CANCELING: ClassVar[int8] = 3
    STATUS_SUCCEEDED: ClassVar[int8] = 4
    STATUS_CANCELED: ClassVar[int8] = 5
    STATUS_ABORTED: ClassVar[int8] = 6

    goal_info: GoalInfo = Field(GoalInfo(), description="The goal.")
    status: int8 = Field(0, description="Its state, one of the constants.")


class GoalStatusArray(Message):
    """The states of all goals of an action, including those that ended a short time ago."""

    status_list: sequence[GoalStatus] = Field((), description="The goals, in the order in which they were accepted.")


class CancelGoal(Service):
    """Cancels goals of an action."""

    class Request(Message):
        """The goals to cancel.

        With an identifier and a zero stamp: this goal. With a zero identifier and a zero stamp: all goals. With a zero
        identifier and a stamp: all goals that were accepted at or before this time. With both: this goal, and all goals
        that were accepted at or before this time.
        """

        goal_info: GoalInfo = Field(GoalInfo(), description="The identifier and the stamp.")

    class Response(Message):
        """Which goals are being cancelled."""

        ERROR_NONE: ClassVar[int8] = 0
        ERROR_REJECTED: ClassVar[int8] = 1
        ERROR_UNKNOWN_GOAL_ID: ClassVar[int8] = 2
        ERROR_GOAL_TERMINATED: ClassVar[int8] = 3

        return_code: int8 = Field(0, description="Zero, or the reason for which no goal is cancelled.")
        goals_canceling: sequence[GoalInfo] = Field((), description="The goals that are being cancelled.")
