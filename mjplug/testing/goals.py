"""A goal that a test sends to an action."""

from collections.abc import Mapping
from typing import Any, Literal

from mjplug_schemas.message import Message


class FakeGoal:
    """A goal, its feedback, and its result when there is one. Implements `mjplug.contracts.actions.GoalQuery`.

    Attributes:
        request: The goal.
        parameters: The parameters of the selector.
        id: The identifier; empty until the goal is accepted.
        fed_back: The feedback so far, messages of the class `Feedback`.
        status: A constant of `action_msgs/msg/GoalStatus` when the goal has ended, otherwise 0.
        result: The result when the goal has ended, otherwise None.
        refusal: The reason for which the goal was rejected; None if it was not.
    """

    form: Literal["cdr", "json"] = "cdr"

    def __init__(self, request: Message, parameters: Mapping[str, str]) -> None:
        self.request = request
        self.parameters = parameters
        self.id = b""
        self.fed_back: list[Any] = []
        self.status = 0
        self.result: Any = None
        self.refusal: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the goal has ended or was rejected."""
        return self.status != 0 or self.refusal is not None

    def accept(self, response: Message, goal_id: bytes) -> None:
        """Stores the identifier."""
        self.id = goal_id

    def feedback(self, message: Any) -> None:
        """Stores the feedback."""
        self.fed_back.append(message.feedback)

    def respond(self, response: Any, goal_id: bytes) -> None:
        """Stores the result."""
        self.status, self.result = response.status, response.result

    def refuse(self, reason: str) -> None:
        """Stores the reason."""
        self.refusal = reason
