"""The bodies that one page drags: the relay adds the viewer's name and a number, and declares the viewer's token."""

import json
from typing import Any

import zenoh

from mjplug.client.errors import ClientError
from mjplug.view.network import Network
from mjplug.view.values import shown

_FIELDS = {"local": 3, "target": 3, "rotate": 4}
"""Number of values of each vector."""

_MAX_VALUE = 1e10
"""Larger numbers are refused, as by the server: MuJoCo's `mjMAXVAL`."""


class Dragging:
    """The drags of one page, one per server.

    Args:
        network: The network.
        viewer: The name of the viewer.
    """

    def __init__(self, network: Network, viewer: str) -> None:
        self._network = network
        self._viewer = viewer
        self._sequence = 0
        # By the key of the server.
        self._tokens: dict[str, Any] = {}

    async def drag(self, message: dict[str, Any]) -> None:
        """Forwards a `drag` request.

        Raises:
            ClientError: A field is invalid, or the access rules of the server forbid drags.
        """
        server = self._network.servers.by_id(message.get("server"))
        if message.get("release") is True:
            self._release(server.key)
            return
        content: dict[str, Any] = {"body": _body(message.get("body"))}
        for name, count in _FIELDS.items():
            if message.get(name) is not None:
                content[name] = _vector(name, message[name], count)
        if "target" not in content and "rotate" not in content:
            raise ClientError("target and rotate are missing; give at least one of them, or release: true")
        await self._network.permissions.require(server)
        if server.key not in self._tokens:
            # The server lets go when this token disappears with the session.
            token = self._network.session.liveliness().declare_token(f"{server.key}/@view/viewer/{self._viewer}")
            self._tokens[server.key] = token
        self._sequence += 1
        self._put(server.key, {"viewer": self._viewer, "seq": self._sequence, **content})

    def close(self) -> None:
        """Releases all bodies."""
        for key in tuple(self._tokens):
            self._release(key)

    def _release(self, key: str) -> None:
        token = self._tokens.pop(key, None)
        self._put(key, {"viewer": self._viewer, "release": True})
        if token is not None:
            token.undeclare()

    def _put(self, key: str, content: dict[str, Any]) -> None:
        self._network.session.put(
            f"{key}/@view/drag",
            json.dumps(content).encode(),
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
        )


def _body(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise ClientError(f"body is {shown(value)}; it must be the id or the name of a body")
    return value


def _vector(name: str, values: object, count: int) -> list[float]:
    if isinstance(values, list) and len(values) == count and all(map(_is_number, values)):
        return values
    raise ClientError(f"{name} is {shown(values)}; it must be a list of {count} numbers below {_MAX_VALUE:g}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _MAX_VALUE
