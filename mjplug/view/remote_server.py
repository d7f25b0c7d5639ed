"""One server of a network, as the relay sees it."""

import contextlib
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, TimedOutError
from mjplug.view.handoff import Handoff
from mjplug.view.queries import ask
from mjplug.wire.discovery.announced import ATTEMPTS, QUERY_TIMEOUT, interfaces_key
from mjplug.wire.discovery.format import ServerInfo, UnreadableListError, checked, parse
from mjplug_schemas import names


class Server:
    """A server, present or gone.

    Attributes:
        id: A number that the name keeps.
        name: The server's full name.
        tokens: Its liveliness tokens; two while a server replaces one of the same name.
    """

    def __init__(self, id: int, name: str) -> None:
        self.id = id
        self.name = name
        self.tokens: set[str] = set()
        self._interfaces: ServerInfo | None = None
        # Number of changes of the list.
        self._version = 0
        self._changes: Any = None

    @property
    def connected(self) -> bool:
        """Whether it is on the network."""
        return bool(self.tokens)

    @property
    def key(self) -> str:
        """The first part of its keys."""
        return names.key(self.name)

    def describe(self) -> dict[str, Any]:
        """Returns its entry in the messages `hello` and `servers`."""
        return {"id": self.id, "name": self.name, "connected": self.connected}

    def forget(self) -> None:
        """Drops its list of interfaces, because it has changed."""
        self._interfaces = None
        self._version += 1

    async def interfaces(self, session: zenoh.Session, handoff: Handoff) -> ServerInfo:
        """Returns its topics and services; asks again only after a change.

        Raises:
            ClientError: It does not answer, or its answer cannot be read.
        """
        if self._changes is None:
            # The server publishes an empty message on this key after each change.
            handler: Callback[zenoh.Sample] = Callback(lambda _: handoff.post(self.forget), indirect=False)
            self._changes = session.declare_subscriber(interfaces_key(self.name), handler)
        if self._interfaces is not None:
            return self._interfaces
        version = self._version
        interfaces = await self._query(session)
        # An answer from before a change is used now, but not kept.
        if version == self._version:
            self._interfaces = interfaces
        return interfaces

    def close(self) -> None:
        """Ends the subscription to changes."""
        if self._changes is not None:
            self._changes.undeclare()
            self._changes = None

    async def _query(self, session: zenoh.Session) -> ServerInfo:
        for _ in range(ATTEMPTS - 1):
            with contextlib.suppress(TimedOutError):
                return await self._ask(session)
        return await self._ask(session)

    async def _ask(self, session: zenoh.Session) -> ServerInfo:
        answer = await ask(session, interfaces_key(self.name), QUERY_TIMEOUT)
        try:
            return parse(checked(self.name, answer))
        except UnreadableListError as error:
            raise ClientError(str(error)) from None
