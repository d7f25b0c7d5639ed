"""The roles of clients, which are identified by the name in their certificate or by their user name."""

from collections.abc import Mapping
from typing import Any, Final, Literal, get_args

from mjplug.errors import MjplugError

Role = Literal["operator", "viewer", "worker", "server"]

ROLES: Final[tuple[Role, ...]] = get_args(Role)

MEANING: Final[Mapping[Role, str]] = {
    "operator": "reads every topic, calls services and actions, publishes to the topics that the server subscribes to",
    "viewer": "reads every topic and parameter; may not publish, and calls only services that change nothing",
    "worker": "a worker process of a server: publishes what the server's plugins publish",
    "server": "a server: everything",
}


class KeysError(MjplugError):
    """Certificates, roles or the folder that contains them are invalid; the message says what to do."""


def read_roles(given: Any, source: str) -> dict[str, Role]:
    """Checks a mapping of names to roles and returns it.

    Args:
        given: The value from a file.
        source: The file, for the error message.

    Raises:
        KeysError: The value is not such a mapping.
    """
    if not isinstance(given, dict) or not given:
        raise KeysError(f'{source}: roles must be a mapping of names to roles, such as {{"alice": "viewer"}}')
    for name, role in given.items():
        if role not in ROLES:
            raise KeysError(f"{source}: {name!r} has the unknown role {role!r}; known: {', '.join(ROLES)}")
    return given
