"""The exceptions of mjplug. Their text is a sentence for the user."""

from __future__ import annotations

import signal
from collections.abc import Iterable

from mjplug.near_names import MAX_NAME_LENGTH, Names


class MjplugError(Exception):
    """Base class of all errors that mjplug raises on purpose."""


class ModelError(MjplugError):
    """The model file cannot be found, read or compiled."""


class WireError(MjplugError):
    """The Zenoh session cannot be opened, or another server already has this identity."""


class PluginError(MjplugError):
    """A plugin cannot be found, refused to start, or failed while running."""


class RequestError(MjplugError):
    """A request is refused; the text is sent to the client that sent the request."""


class UnknownName(RequestError):  # noqa: N818  (the name already says what is wrong)
    """A name does not exist in the model or in another list of names.

    Args:
        kind: The kind of object, such as `body`.
        name: The name that does not exist.
        allowed: The names that exist. For many names, pass a prebuilt `Names` to save time.
    """

    def __init__(self, kind: str, name: str, allowed: Iterable[str] | Names) -> None:
        names = allowed if isinstance(allowed, Names) else Names(allowed)
        super().__init__(f"unknown {kind} {quoted(name)}{did_you_mean(name, names)}; {_listing(kind, names)}")


def is_fault(error: BaseException) -> bool:
    """Returns whether an exception from a plugin's code is a failure of the plugin, which must not end the process.

    SystemExit is a failure. KeyboardInterrupt is a failure too, unless Python's default handler of SIGINT is installed,
    as in a script that runs a server; then the user has pressed Ctrl-C.
    """
    if isinstance(error, KeyboardInterrupt):
        return signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    return isinstance(error, Exception | SystemExit)


def did_you_mean(name: str, allowed: Iterable[str] | Names) -> str:
    """Returns `, did you mean 'x'?` if `name` is similar to an allowed name, otherwise an empty string."""
    near = (allowed if isinstance(allowed, Names) else Names(allowed)).nearest(name)
    return "" if near is None else f", did you mean {near!r}?"


def quoted(name: str) -> str:
    """Returns a name in quotes; a name longer than `MAX_NAME_LENGTH` is shortened."""
    return repr(name) if len(name) <= MAX_NAME_LENGTH else f"{name[:MAX_NAME_LENGTH]!r}… ({len(name)} characters)"


def _listing(kind: str, names: Names, max_names: int = 20) -> str:
    if not len(names):
        return f"there is no {kind}"
    more = f", … ({len(names)} in all)" if len(names) > max_names else ""
    return "known: " + ", ".join(names.first(max_names)) + more
