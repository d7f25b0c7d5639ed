"""The ROS package rosgraph_msgs: the clock."""

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.message import Message


class Clock(Message):
    """The simulated time, for nodes with `use_sim_time`."""

    clock: Time = Field(Time(), description="The time now [s, ns].")
