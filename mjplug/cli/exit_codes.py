"""Exit codes of the process."""

from mjplug.client.errors import NoServerError, RequestRefused, TimedOutError, WrongTypeError
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError, ModelError, WireError
from mjplug.lifecycle.watchdog import FORCED_STOP

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
"""Exit codes by error, the most specific first."""

EXIT_CODES_OF_COMMANDS = frozenset({0, 1, 2, 3, 4, 5, 6, 7, FORCED_STOP, 130, 143})
"""All exit codes of the command line: success, usage errors, those above, and those of signals."""


def exit_code(error: MjplugError) -> int:
    """Returns the exit code for an error."""
    return next(code for kind, code in EXIT_CODES if isinstance(error, kind))
