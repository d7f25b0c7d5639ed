"""What all pages share of one Zenoh network."""

import asyncio
import json
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import zenoh

from mjplug.client.errors import ClientError, WrongTypeError
from mjplug.client.types import find
from mjplug.view.definitions import definitions, with_nested
from mjplug.view.feeds import Feeds
from mjplug.view.handoff import Handoff
from mjplug.view.permission import Permissions
from mjplug.view.queries import ask
from mjplug.view.remote_server import Server
from mjplug.view.scenes import Scenes
from mjplug.view.servers import Servers
from mjplug.view.watching import Watched
from mjplug.wire.discovery.announced import interfaces_key
from mjplug_schemas.definition import definition

_TYPES_TIMEOUT = 5.0
"""Timeout of the query for the types of a server [s]."""


class Network:
    """Servers, subscriptions and drawing packs. Event loop only.

    Attributes:
        session: The session.
        servers: The servers.
        feeds: The subscriptions.
        scenes: The drawing packs.
        permissions: Whether this client may command a server.

    Args:
        session: An open session, which is not closed here.
        handoff: Calls functions on the event loop.
        chosen: The full names of the servers to show; empty means all.
        on_change: Called when a server has appeared or left.
    """

    def __init__(
        self,
        session: zenoh.Session,
        handoff: Handoff,
        chosen: Collection[str],
        on_change: Callable[[], None],
    ) -> None:
        self.session = session
        self.feeds = Feeds(session, handoff)
        self.scenes = Scenes(session)
        self.permissions = Permissions(session)
        self._sender = ThreadPoolExecutor(1, thread_name_prefix="view publishes")
        self._watched: dict[int, Watched] = {}
        self._on_change = on_change
        self.servers = Servers(session, handoff, chosen, self._changed)

    def watched(self, server: Server) -> Watched:
        """Returns what pages watch of a server."""
        if server.id not in self._watched:
            self._watched[server.id] = Watched(server, self.session, self.feeds, self.scenes)
        return self._watched[server.id]

    def all_watched(self) -> list[Watched]:
        """Returns what pages watch or have watched, of all servers."""
        return list(self._watched.values())

    async def definitions(self, type: str) -> dict[str, str]:
        """Returns `definition` of a message type, or `request` and `response` of a service type, with nested types.

        Raises:
            WrongTypeError: Neither `mjplug_schemas` nor a server knows the type.
        """
        try:
            return definitions(type)
        except WrongTypeError:
            types: dict[str, str] = {}
            for server, _ in await self.servers.interfaces():
                types |= await self._types(server)
            if type not in types:
                raise
        parts = types[type].split("\n---\n") if "/srv/" in type else [types[type]]
        names = ("request", "response") if "/srv/" in type else ("definition",)
        return {
            name: with_nested(part, lambda nested: types[nested] if nested in types else definition(find(nested)))
            for name, part in zip(names, parts, strict=False)
        }

    def publish(self, key: str, payload: bytes, encoding: Any) -> "asyncio.Future[None]":
        """Publishes a message, after those before it, on a thread: on a full link, it waits.

        Args:
            key: The key.
            payload: The payload.
            encoding: Its encoding.
        """
        return asyncio.wrap_future(self._sender.submit(self._put, key, payload, encoding))

    def close(self) -> None:
        """Ends all subscriptions and queries; the session stays open."""
        # The last messages stop robots.
        self._sender.shutdown()
        self.servers.close()
        for watched in self._watched.values():
            watched.close()
        self.feeds.close()
        self.scenes.close()
        self.permissions.close()

    def _put(self, key: str, payload: bytes, encoding: Any) -> None:
        self.session.put(
            key,
            payload,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
        )

    async def _types(self, server: Server) -> dict[str, str]:
        try:
            answer = await ask(self.session, f"{interfaces_key(server.name)}?schema=true", _TYPES_TIMEOUT)
            entries = json.loads(answer)["types"]
            return {str(name): str(entry["definition"]) for name, entry in entries.items()}
        except ClientError:
            return {}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise WrongTypeError(f"{server.name} sent a list of types that cannot be read: {error!r}") from None

    def _changed(self, server: Server) -> None:
        self.permissions.forget(server)
        if server.id in self._watched:
            self._watched[server.id].server_changed()
        self._on_change()
