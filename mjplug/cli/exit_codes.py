"""What ends the process with which code."""

from mjplug.client.errors import NoServerError, RequestRefused, TimedOutError, WrongTypeError
from mjplug.errors import ConfigError, MjplugError, ModelError, WireError

EXIT_CODES: tuple[tuple[type[MjplugError], int], ...] = (
    (WrongTypeError, 2),
    (ConfigError, 3),
    (ModelError, 4),
    (WireError, 5),
    (NoServerError, 5),
    (TimedOutError, 6),
    (RequestRefused, 7),
    (MjplugError, 1),
)
"""Exit codes by error, the most specific first; 0 is success, 2 a usage error, 130 Ctrl-C."""


def exit_code(error: MjplugError) -> int:
    """Returns the exit code for an error."""
    return next(code for kind, code in EXIT_CODES if isinstance(error, kind))
