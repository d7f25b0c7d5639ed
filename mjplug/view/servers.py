"""The servers of a network: which there are, and their topics and services."""

import asyncio
import logging
from collections.abc import Callable, Collection, Iterable
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, NoServerError, UnknownNameError
from mjplug.client.graph import GIVE_TYPE
from mjplug.view.handoff import Handoff
from mjplug.view.remote_server import Server
from mjplug.view.values import shown
from mjplug.wire.discovery.announced import TOKENS
from mjplug.wire.discovery.format import ServerInfo, ServiceInfo, TopicInfo, all_services, all_topics
from mjplug_schemas import names
from mjplug_schemas.errors import NameRuleError

_log = logging.getLogger(__name__)

MAX_SERVERS = 255
"""Maximum number of servers; the id of a server is one byte."""


class Servers:
    """The servers of a network. Event loop only.

    Args:
        session: The session.
        handoff: Calls functions on the event loop.
        chosen: The full names of the servers to show; empty means all.
        on_change: Called with a server that has appeared, has left, or has been replaced by one of the same name.
    """

    def __init__(
        self,
        session: zenoh.Session,
        handoff: Handoff,
        chosen: Collection[str],
        on_change: Callable[[Server], None],
    ) -> None:
        self._session = session
        self._handoff = handoff
        self._chosen = frozenset(chosen)
        self._on_change = on_change
        self._servers: dict[str, Server] = {}
        self._declared = session.liveliness().declare_subscriber(
            f"{TOKENS}/**", Callback(self._token, indirect=False), history=True
        )

    def describe(self) -> list[dict[str, Any]]:
        """Returns the servers for the messages `hello` and `servers`."""
        return [server.describe() for server in self._servers.values()]

    def by_id(self, id: object) -> Server:
        """Returns a server by its id.

        Raises:
            ClientError: There is none.
        """
        for server in self._servers.values():
            if server.id == id and not isinstance(id, bool):
                return server
        there = ", ".join(f"{server.id} ({server.name})" for server in self._servers.values())
        raise ClientError(f"server is {shown(id)}; " + (f"there are: {there}" if there else "there is none yet"))

    def by_name(self, name: str) -> Server:
        """Returns a server by its full name, which exists."""
        return self._servers[name]

    def resolve(self, name: object, id: object) -> str:
        """Returns a full name; `~` is the server with an id, or the only one.

        Raises:
            ClientError: It breaks one of ROS's rules, or `~` is ambiguous.
        """
        if not isinstance(name, str):
            raise ClientError(f"the name is {shown(name)}; it must be a string such as /clock")
        full = f"{self._home(id).name}{name[1:]}" if name.startswith("~/") else f"/{name.removeprefix('/')}"
        try:
            names.validate_name(full)
        except NameRuleError as error:
            raise ClientError(str(error)) from None
        return full

    async def interfaces(self) -> list[tuple[Server, ServerInfo]]:
        """Returns the topics and services of all servers; a server that does not answer is omitted."""
        return (await self._survey())[0]

    async def listing(self) -> dict[str, Any]:
        """Returns the topics and services of all servers, for the page."""
        found = await self.interfaces()
        ids = {server.name: server.id for server, _ in found}
        return {
            "topics": [
                {
                    "name": topic.name,
                    "type": topic.type,
                    "publishers": len(topic.publishers),
                    "subscribers": len(topic.subscribers),
                    "server": ids[(*topic.publishers, *topic.subscribers)[0]],
                }
                for topic in all_topics(info for _, info in found).values()
            ],
            "services": [
                {"name": service.name, "type": service.type, "server": server.id}
                for server, info in found
                for service in info.services.values()
            ],
        }

    async def topics(self) -> dict[str, TopicInfo]:
        """Returns the topics of all servers by name."""
        return all_topics(info for _, info in await self.interfaces())

    async def topic(self, full: str) -> TopicInfo:
        """Returns a topic by its full name.

        Raises:
            UnknownNameError: No server that answers has it.
        """
        found, silent = await self._survey()
        topics = all_topics(info for _, info in found)
        if full not in topics:
            raise UnknownNameError("topic", full, topics, silent, hint=GIVE_TYPE)
        return topics[full]

    async def service(self, full: str) -> ServiceInfo:
        """Returns a service by its full name.

        Raises:
            UnknownNameError: No server that answers offers it.
        """
        found, silent = await self._survey()
        services = all_services(info for _, info in found)
        if full not in services:
            raise UnknownNameError("service", full, services, silent)
        return services[full]

    def close(self) -> None:
        """Ends all subscriptions."""
        # zenoh's stubs leave the return type open.
        self._declared.undeclare()  # type: ignore[no-untyped-call]
        for server in self._servers.values():
            server.close()

    async def _survey(self) -> tuple[list[tuple[Server, ServerInfo]], list[str]]:
        """Returns the topics and services of the servers that answer, and the names of the others."""
        present = [server for server in self._servers.values() if server.connected]
        answers = await asyncio.gather(
            *(server.interfaces(self._session, self._handoff) for server in present), return_exceptions=True
        )
        found, silent = [], []
        for server, answer in zip(present, answers, strict=True):
            if isinstance(answer, ServerInfo):
                found.append((server, answer))
            elif isinstance(answer, ClientError):
                _log.warning("%s", answer)
                silent.append(server.name)
            elif isinstance(answer, BaseException):
                raise answer
        return found, silent

    def _home(self, id: object) -> Server:
        if id is not None:
            return self.by_id(id)
        present: Iterable[Server] = [server for server in self._servers.values() if server.connected]
        match list(present):
            case [only]:
                return only
            case []:
                raise NoServerError("there is no server")
            case several:
                listed = ", ".join(f"{server.id} ({server.name})" for server in several)
                raise ClientError(f"several servers are running, so `~` needs the field `server`: {listed}")

    def _token(self, sample: zenoh.Sample) -> None:
        """Handles an appearing or disappearing token. Zenoh's thread."""
        token, appeared = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        self._handoff.post(lambda: self._changed(token, appeared))

    def _changed(self, token: str, appeared: bool) -> None:
        # @mjplug/<namespace>/<node name>/<Zenoh id>
        name = "/" + "/".join(token.split("/")[1:-1])
        server = self._servers.get(name)
        if server is None:
            server = self._added(name) if appeared else None
        if server is None or appeared == (token in server.tokens):
            return
        if appeared:
            server.tokens.add(token)
        else:
            server.tokens.discard(token)
        server.forget()
        self._on_change(server)

    def _added(self, name: str) -> Server | None:
        if (self._chosen and name not in self._chosen) or len(self._servers) >= MAX_SERVERS:
            return None
        try:
            names.validate_name(name)
        except NameRuleError:
            # No server can have this name; any program can declare such a token.
            return None
        server = self._servers[name] = Server(len(self._servers), name)
        return server
