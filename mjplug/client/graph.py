"""What is on a network: its servers, their topics and services, and what names stand for."""

import time
from typing import Any

import zenoh

from mjplug.client import listing
from mjplug.client.errors import ClientError, NoServerError, TimedOutError, UnknownNameError
from mjplug.client.listing import ServerInfo, ServiceInfo, TopicInfo
from mjplug.client.patience import bounded
from mjplug.client.types import find
from mjplug_schemas import names
from mjplug_schemas.errors import NameRuleError

_POLL = 0.05
"""How often `wait_for` looks [s]."""


class Graph:
    """The servers of one network and what they offer. Every call looks at what there is now. Thread-safe.

    Attributes:
        endpoint: Where it is connected.

    Args:
        session: An open session.
        endpoint: As above.
        server: The name of the server that `~` stands for; empty is the only one there is.
    """

    def __init__(self, session: zenoh.Session, endpoint: str, server: str = "") -> None:
        self._session = session
        self._closed = False
        self.endpoint = endpoint
        self._server = server

    @property
    def session(self) -> zenoh.Session:
        """The Zenoh session, for what there is no method for.

        Raises:
            ClientError: It is closed.
        """
        if self._closed:
            raise ClientError(f"the client of {self.endpoint} is closed")
        return self._session

    @property
    def server(self) -> ServerInfo:
        """The server that `~` stands for, as it is now.

        Raises:
            ClientError: There are several, and none was chosen.
            NoServerError: It is gone.
        """
        return listing.parse(listing.ask(self.session, self._name()))

    def servers(self) -> dict[str, ServerInfo]:
        """Returns all servers of the network by name; one that is just stopping may be missing."""
        found, session = {}, self.session
        for name in listing.server_names(session):
            try:
                found[name] = listing.parse(listing.ask(session, name))
            except ClientError:
                continue
        return found

    def nodes(self) -> list[str]:
        """Returns the full names of all servers; each of them is a node to ROS."""
        return list(listing.server_names(self.session))

    def topics(self) -> dict[str, TopicInfo]:
        """Returns the topics of all servers by name."""
        return listing.all_topics(self.servers().values())

    def services(self) -> dict[str, ServiceInfo]:
        """Returns the services of all servers by name."""
        return listing.all_services(self.servers().values())

    def topic(self, name: str) -> TopicInfo:
        """Returns what is known of a topic.

        Raises:
            UnknownNameError: No server has it.
        """
        found: TopicInfo = self._known("topic", name, self.topics())
        return found

    def service(self, name: str) -> ServiceInfo:
        """Returns what is known of a service.

        Raises:
            UnknownNameError: No server offers it.
        """
        found: ServiceInfo = self._known("service", name, self.services())
        return found

    def resolve(self, name: str) -> str:
        """Returns the full name that a name stands for: `clock` is `/clock`, `~/epoch` is `/mjplug/epoch`.

        Raises:
            ClientError: It breaks one of ROS's rules.
        """
        full = f"{self._name()}{name[1:]}" if name.startswith("~/") else f"/{name.removeprefix('/')}"
        try:
            names.validate_name(full)
        except NameRuleError as error:
            raise ClientError(str(error)) from None
        return full

    def find(self, type: str) -> type[Any]:
        """Returns the class of a ROS type such as `std_msgs/msg/String`, or of what a topic or service carries.

        Args:
            type: The name of a type, or the name of a topic or service (`/clock`, `~/set_pause`).

        Raises:
            WrongTypeError: There is no class for the type.
            UnknownNameError: There is no such topic or service.
        """
        if not type.startswith(("/", "~")):
            return find(type)
        offered: dict[str, Any] = {**self.topics(), **self.services()}
        return find(self._known("topic or service", type, offered).type)

    def wait_for(self, name: str, timeout: float = 10.0) -> TopicInfo | ServiceInfo:
        """Waits until a topic or a service is there.

        Args:
            name: Its name.
            timeout: How long to wait [s].

        Raises:
            TimedOutError: It did not come in time.
        """
        until = time.monotonic() + bounded(timeout)
        while (found := self._there(name)) is None:
            if time.monotonic() >= until:
                raise TimedOutError(f"neither a topic nor a service {name} appeared within {timeout:g} s")
            time.sleep(_POLL)
        return found

    def _there(self, name: str) -> TopicInfo | ServiceInfo | None:
        try:
            full = self.resolve(name)
        except NoServerError:
            # It may be about to start.
            return None
        for server in self.servers().values():
            if found := server.topics.get(full) or server.services.get(full):
                return found
        return None

    def _name(self) -> str:
        if self._server:
            return self._server
        there = listing.server_names(self.session)
        if len(there) == 1:
            return there[0]
        if not there:
            raise NoServerError(f"no mjplug server is on the network of {self.endpoint} any more")
        raise ClientError(
            f"there are several servers: {', '.join(there)}; choose one (connect(server=...), --server), "
            "or use full names"
        )

    def _known(self, kind: str, name: str, offered: dict[str, Any]) -> Any:
        full = self.resolve(name)
        if full not in offered:
            raise UnknownNameError(kind, full, offered)
        return offered[full]
