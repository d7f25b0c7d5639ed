"""What can go wrong for a client, as exceptions whose text is for a person."""

from collections.abc import Iterable, Sequence
from typing import Any

from mjplug.errors import MjplugError, did_you_mean, quoted

_MOST_LISTED = 20


class ClientError(MjplugError):
    """Root of what the client raises on purpose."""


class NoServerError(ClientError):
    """Nobody is there to talk to; the sentence says what to try."""


class UnknownNameError(ClientError):
    """A topic, service or server that is not on the network.

    Args:
        kind: What was looked for, such as `topic`.
        name: Its name.
        known: The names there are.
        silent: Servers that are announced but did not answer; one of them may have it.
        hint: What to do if the name is right.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], silent: Sequence[str] = (), hint: str = "") -> None:
        names = sorted(set(known))
        more = f", … ({len(names)} in all)" if len(names) > _MOST_LISTED else ""
        there = f"there are: {', '.join(names[:_MOST_LISTED])}{more}" if names else f"there is no {kind} at all"
        if silent:
            there += f"; announced, but without an answer: {', '.join(silent[:_MOST_LISTED])}"
        super().__init__(f"unknown {kind} {quoted(name)}{_suggestion(name, names)}; {there}{hint and f'; {hint}'}")


def _suggestion(name: str, names: list[str]) -> str:
    """Returns a guess: a name that ends alike, most likely one whose namespace was left out, or a similar one."""
    alike = [other for other in names if other.rpartition("/")[2] == name.rpartition("/")[2]]
    return f", did you mean {alike[0]!r}?" if len(alike) == 1 else did_you_mean(name, names)


class WrongTypeError(ClientError):
    """A message, or a type, that is not that of the topic or service."""


class TimedOutError(ClientError):
    """Something did not happen in time."""


class RequestRefused(ClientError):  # noqa: N818  (what is wrong is in the name already)
    """A service was asked and said no.

    Attributes:
        service: The service's full name.
        reason: What it said.
        response: Its response, whose `success` is false; None if it answered with an error instead.

    Args:
        service: As above.
        reason: As above.
        response: As above.
    """

    def __init__(self, service: str, reason: str, response: Any = None) -> None:
        super().__init__(f"{service} refused: {reason}" if reason else f"{service} refused, and did not say why")
        self.service = service
        self.reason = reason
        self.response = response
