"""Goals of actions, as the handler of an action sees them. Physics thread only."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from mjplug.errors import MjplugError
from mjplug_schemas.action import Action
from mjplug_schemas.action_msgs import GoalInfo, GoalStatus
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.message import Message
from mjplug_schemas.unique_identifier_msgs import UUID

ENDED: Final = (GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED)
"""The states of goals that have ended."""

_REASONS = ("error_string", "error_message", "message", "status_message", "reason")
"""Names of the text field of a result that contains the reason for a failure, most common first."""


class GoalCanceled(MjplugError):  # noqa: N818  (the name says what has happened)
    """Raised inside the handler of a goal, where it waits, when a client cancels the goal."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a goal ended.

    Attributes:
        status: One of `ENDED`.
        result: The result.
    """

    status: int
    result: Message


class Goal:
    """A goal of an action: what its client wants, and how it is reported to the client.

    Attributes:
        id: The identifier that the client has chosen, 16 bytes.
        request: The goal, a message of the class `Goal` of the action.
        stamp: Simulated time at which the goal was sent.
        status: One of the constants of `action_msgs/msg/GoalStatus`; 0 until the goal is accepted.

    Args:
        type: The action's class.
        id: As above.
        request: As above.
        stamp: As above.
        publish: Publishes feedback of the goal.
        observed: Returns whether anybody gets the feedback.
    """

    def __init__(
        self,
        type: type[Action],
        id: bytes,
        request: Message,
        stamp: Time,
        publish: Callable[["Goal", Message], None],
        observed: Callable[["Goal"], bool],
    ) -> None:
        self.id = id
        self.request: Any = request
        self.stamp = stamp
        self.status: int = GoalStatus.STATUS_UNKNOWN
        self._type = type
        self._publish = publish
        self._observed = observed
        self._early: list[Message] = []

    @property
    def info(self) -> GoalInfo:
        """The identifier and the stamp as a message."""
        return GoalInfo(goal_id=UUID(uuid=self.id), stamp=self.stamp)

    @property
    def accepted(self) -> bool:
        """Whether the goal was accepted."""
        return self.status != GoalStatus.STATUS_UNKNOWN

    @property
    def ended(self) -> bool:
        """Whether the goal has ended."""
        return self.status in ENDED

    @property
    def observed(self) -> bool:
        """Whether anybody gets the feedback; if not, there is no need to build a message."""
        return self._observed(self)

    def feedback(self, message: Message) -> None:
        """Publishes feedback. After the goal has ended, it does nothing.

        Args:
            message: A message of the class `Feedback` of the action.

        Raises:
            TypeError: The message has another type.
        """
        self._check(message, self._type.Feedback)
        if not self.accepted:
            # The client does not know yet whether the server accepts the goal.
            self._early.append(message)
        elif not self.ended:
            self._publish(self, message)

    def succeeded(self, result: Message | None = None) -> Outcome:
        """Returns the outcome of a goal that was reached; None means a result with default values."""
        return self._outcome(GoalStatus.STATUS_SUCCEEDED, result)

    def aborted(self, result: Message | None = None) -> Outcome:
        """Returns the outcome of a goal that could not be reached; None means a result with default values."""
        return self._outcome(GoalStatus.STATUS_ABORTED, result)

    def canceled(self, result: Message | None = None) -> Outcome:
        """Returns the outcome of a goal that a client has cancelled; None means a result with default values."""
        return self._outcome(GoalStatus.STATUS_CANCELED, result)

    def outcome(self, returned: Any) -> Outcome:
        """Returns the outcome for what a handler has returned: an outcome or a result.

        Raises:
            TypeError: It is neither.
        """
        if isinstance(returned, Outcome):
            return returned
        canceling = self.status == GoalStatus.STATUS_CANCELING
        return self.canceled(returned) if canceling else self.succeeded(returned)

    def accept(self) -> None:
        """Marks the goal as accepted, and publishes the feedback that the handler has given so far."""
        self.status = GoalStatus.STATUS_EXECUTING
        early, self._early = self._early, []
        for message in early:
            self._publish(self, message)

    def _outcome(self, status: int, result: Message | None) -> Outcome:
        result = self._type.Result() if result is None else result
        self._check(result, self._type.Result)
        return Outcome(status, result)

    @staticmethod
    def _check(message: object, wanted: type[Message]) -> None:
        if type(message) is not wanted:
            raise TypeError(f"expected a {wanted.TYPE}, not {type(message).__name__}")


def failure(type: type[Action], reason: str) -> Message:
    """Returns a result that contains the reason of a failure, if the result has a text field for it."""
    fields = type.Result.model_fields
    text = next((name for name in _REASONS if name in fields and fields[name].annotation is str), None)
    return type.Result(**({text: reason} if text else {}))
