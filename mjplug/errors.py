"""What can go wrong, as exceptions that build the sentence a person reads."""

from __future__ import annotations

import signal
from collections.abc import Iterable

from mjplug.near_names import LONGEST, Names

_LONGEST_NAME = LONGEST
"""Characters of a wrong name that are shown."""


class MjplugError(Exception):
    """Root of every error that mjplug raises on purpose."""


class ModelError(MjplugError):
    """The model file cannot be found, read or compiled."""


class WireError(MjplugError):
    """The Zenoh session cannot be opened, or another server already has this identity."""


class PluginError(MjplugError):
    """A plugin cannot be found, refused to start, or failed while running."""


class RequestError(MjplugError):
    """A request is refused; the sentence goes to the client that sent it."""


class UnknownName(RequestError):  # noqa: N818  (what is wrong is in the name already)
    """A name that the model (or a table) does not have.

    Args:
        kind: What was looked up, such as `body`.
        name: The name that is not there.
        allowed: The names that are. Where they may be many and time counts, give `Names` that were made before.
    """

    def __init__(self, kind: str, name: str, allowed: Iterable[str] | Names) -> None:
        names = allowed if isinstance(allowed, Names) else Names(allowed)
        super().__init__(f"unknown {kind} {quoted(name)}{did_you_mean(name, names)}; {_listing(kind, names)}")


def is_fault(error: BaseException) -> bool:
    """Whether an exception out of a plugin's code is a failure of the plugin, which must not end the process.

    `sys.exit()` is one. KeyboardInterrupt is one too, unless Python's own handler of SIGINT is in place, as in a script
    that runs a server: then it is the user's Ctrl-C.
    """
    if isinstance(error, KeyboardInterrupt):
        return signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    return isinstance(error, Exception | SystemExit)


def did_you_mean(name: str, allowed: Iterable[str] | Names) -> str:
    """Returns `, did you mean 'x'?` for a name close to an allowed one, otherwise an empty string."""
    near = (allowed if isinstance(allowed, Names) else Names(allowed)).nearest(name)
    return "" if near is None else f", did you mean {near!r}?"


def quoted(name: str) -> str:
    """Returns a name that somebody sent in quotes, shortened if it is absurdly long."""
    return repr(name) if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]!r}… ({len(name)} characters)"


def _listing(kind: str, names: Names, most: int = 20) -> str:
    if not len(names):
        return f"there is no {kind}"
    more = f", … ({len(names)} in all)" if len(names) > most else ""
    return "known: " + ", ".join(names.first(most)) + more
