"""A plugin for benchmarks, whose goals end at once."""

from typing import Any

from mjplug.plugin import Goal, Host, Parameters, Plugin
from mjplug_schemas.control_msgs_action import GripperCommand
from mjplug_schemas.message import Message


class EndedGoal(Plugin[Parameters]):
    """Action `/ended_goal`: every goal succeeds without a wait."""

    stateless = True

    def init(self, host: Host, parameters: Parameters) -> None:
        """Declares the action."""
        host.create_action(GripperCommand, "/ended_goal", self._end)

    @staticmethod
    def _end(request: Any, goal: Goal) -> Message:
        return GripperCommand.Result(reached_goal=True)
