"""Which client steps the server. A client keeps the ownership until its liveliness token disappears. Physics thread."""

import logging
import re
from collections.abc import Callable, Mapping
from time import perf_counter

from mjplug.errors import RequestError, quoted
from mjplug.physics.scheduler import Event

MAX_TOKEN_WAIT = 2.0
"""Maximum wall time for which a request waits for the liveliness token of its client [s]. The token and the request
take different paths."""

_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")

_log = logging.getLogger(__name__)


class Ownership:
    """The client that steps the server: at most one at a time.

    Attributes:
        owner: Name of the client; empty if there is none.
        on_left: Called with the owner's name when its token has disappeared.

    Args:
        keys: Prefix of the keys of liveliness tokens, which end with the client's name.
    """

    def __init__(self, keys: str) -> None:
        self.owner = ""
        self.on_left: list[Callable[[str], None]] = []
        self._keys = keys
        self._present: set[str] = set()
        self._awaited: dict[str, tuple[float, Event]] = {}

    @staticmethod
    def name_in(parameters: Mapping[str, str]) -> str:
        """Returns the name of the client that sent a request, from the parameter `owner`; empty if there is none.

        Raises:
            RequestError: The name is not valid.
        """
        name = parameters.get("owner", "")
        if name and not _NAME.fullmatch(name):
            raise RequestError(
                f"owner is {quoted(name)}; it must have 1 to 64 English letters, digits, '_', '.' and '-'"
            )
        return name

    def check(self, name: str) -> None:
        """Checks that no other client steps the server.

        Raises:
            RequestError: Another client does.
        """
        if self.owner and self.owner != name:
            raise RequestError(
                f"another client steps this server (owner {self.owner!r}); wait until it has disconnected"
            )

    def is_present(self, name: str) -> bool:
        """Returns whether the client's liveliness token exists."""
        return name in self._present

    def appears(self, name: str) -> Event:
        """Returns an event that is set when the client's token appears, and at the latest after `MAX_TOKEN_WAIT`."""
        if name not in self._awaited:
            self._awaited[name] = perf_counter(), Event()
        return self._awaited[name][1]

    def claim(self, name: str) -> None:
        """Makes a client the owner. Without a name, nothing changes.

        Raises:
            RequestError: Another client is the owner, or the client's token does not exist.
        """
        self.check(name)
        if name and name not in self._present:
            raise RequestError(
                f"the liveliness token {self._keys}/{name} does not exist; declare it before the first step, and keep "
                "it while you step the server"
            )
        self.owner = name

    def changed(self, name: str, present: bool) -> None:
        """Handles a token that has appeared or disappeared."""
        if present:
            self._present.add(name)
            _, event = self._awaited.pop(name, (0.0, None))
            if event is not None:
                event.set()
            return
        self._present.discard(name)
        if name == self.owner:
            self.owner = ""
            _log.info("the client that stepped the server has left (owner %r)", name)
            for callback in self.on_left:
                callback(name)

    def release(self, name: str) -> None:
        """Ends the ownership of a client whose token still exists; does nothing if it is not the owner."""
        if name == self.owner:
            self.owner = ""

    def expire(self, now: float) -> None:
        """Ends the waits for tokens that have not appeared; called about once a second with the wall time [s]."""
        for name in [name for name, (began, _) in self._awaited.items() if now - began >= MAX_TOKEN_WAIT]:
            self._awaited.pop(name)[1].set()
