"""Exceptions of the client. Their texts are error messages for users."""

from collections.abc import Iterable, Sequence
from typing import Any

from mjplug.errors import MjplugError, did_you_mean, quoted

_MOST_LISTED = 20


class ClientError(MjplugError):
    """Base class of the client's exceptions."""


class NoServerError(ClientError):
    """No server can be reached; the message says what to try."""


class UnknownNameError(ClientError):
    """A topic, service, server or parameter that does not exist.

    Args:
        kind: The kind of name, such as `topic`.
        name: Its name.
        known: The existing names.
        silent: Servers that are announced but did not answer; they may have this name.
        hint: What to do if the name is correct.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], silent: Sequence[str] = (), hint: str = "") -> None:
        names = sorted(set(known))
        more = f", … ({len(names)} in all)" if len(names) > _MOST_LISTED else ""
        there = f"there are: {', '.join(names[:_MOST_LISTED])}{more}" if names else f"there is no {kind} at all"
        if silent:
            there += f"; announced, but not answering: {', '.join(silent[:_MOST_LISTED])}"
        super().__init__(f"unknown {kind} {quoted(name)}{_suggestion(name, names)}; {there}{hint and f'; {hint}'}")


def _suggestion(name: str, names: list[str]) -> str:
    """Returns a suggestion: the only name that differs in the namespace alone, or a similar name."""
    alike = [other for other in names if other.rpartition("/")[2] == name.rpartition("/")[2]]
    return f", did you mean {alike[0]!r}?" if len(alike) == 1 else did_you_mean(name, names)


class WrongTypeError(ClientError):
    """A message or a type does not match the topic or service."""


class TimedOutError(ClientError):
    """A timeout has passed."""


class RequestRefused(ClientError):  # noqa: N818  (the name says that it is an error)
    """A service has refused a request.

    Attributes:
        service: The service's full name.
        reason: The reason in the response.
        response: The response with `success: false`; None if the service replied with an error.

    Args:
        service: As above.
        reason: As above.
        response: As above.
    """

    def __init__(self, service: str, reason: str, response: Any = None) -> None:
        super().__init__(f"{service} refused: {reason}" if reason else f"{service} refused without a reason")
        self.service = service
        self.reason = reason
        self.response = response


class GoalFailed(ClientError):  # noqa: N818  (the name says that it is an error)
    """A goal of an action was aborted or cancelled.

    Attributes:
        action: The action's full name.
        status: `ABORTED` or `CANCELED`.
        reason: The reason in the result; empty if there is none.
        result: The result.

    Args:
        action: As above.
        status: As above.
        reason: As above.
        result: As above.
    """

    def __init__(self, action: str, status: str, reason: str, result: Any) -> None:
        super().__init__(f"the goal of {action} was {status.lower()}{f': {reason}' if reason else ''}")
        self.action = action
        self.status = status
        self.reason = reason
        self.result = result
