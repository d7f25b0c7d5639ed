"""The servers of a network, their topics, services and actions, and the resolution of names."""

import logging
import time
from typing import Any

import zenoh

from mjplug.client.errors import ClientError, NoServerError, TimedOutError, UnknownNameError
from mjplug.client.timeouts import bounded
from mjplug.client.types import find
from mjplug.wire.discovery import questions
from mjplug.wire.discovery.announced import NoAnswerError, server_names
from mjplug.wire.discovery.format import (
    ActionInfo,
    ServerInfo,
    ServiceInfo,
    TopicInfo,
    UnreadableListError,
    all_actions,
    all_services,
    all_topics,
    parse,
)
from mjplug_schemas import names
from mjplug_schemas.errors import NameRuleError

_log = logging.getLogger(__name__)

_NEAREST = 2
"""Maximum number of servers that are asked individually for a name before all are asked."""

_POLL = 0.05
"""Polling interval of `wait_for` [s]."""


GIVE_TYPE = "if the name is right, give its type, such as geometry_msgs/msg/Twist"
"""Hint for a topic that no server has, so that its type is unknown."""


class Graph:
    """The servers of one network, their topics and services. Every call asks the servers again. Thread-safe.

    Attributes:
        endpoint: The endpoint to which the client is connected.

    Args:
        session: An open session.
        endpoint: As above.
        server: The name of the server to use for `~`; if empty, there must be only one server.
    """

    def __init__(self, session: zenoh.Session, endpoint: str, server: str = "") -> None:
        self._session = session
        self._closed = False
        self.endpoint = endpoint
        self._server = server
        self._silent: set[str] = set()

    @property
    def session(self) -> zenoh.Session:
        """The Zenoh session, for uses that this class does not cover.

        Raises:
            ClientError: The client is closed.
        """
        if self._closed:
            raise ClientError(f"the client of {self.endpoint} is closed")
        return self._session

    @property
    def server(self) -> ServerInfo:
        """The server for `~`, with its current topics and services.

        Raises:
            ClientError: Several servers are running, and none was chosen.
            NoServerError: The server has stopped, or does not answer.
        """
        return self._ask(self._name())

    def servers(self) -> dict[str, ServerInfo]:
        """Returns all servers of the network by name.

        One query asks all servers. If an announced server does not answer this and a second query, it is omitted and a
        warning is logged once.
        """
        return self._ask_all()[0]

    def nodes(self) -> list[str]:
        """Returns the full names of all servers; each is a ROS node."""
        return list(self._names())

    def topics(self) -> dict[str, TopicInfo]:
        """Returns the topics of all servers by name."""
        return all_topics(self.servers().values())

    def services(self) -> dict[str, ServiceInfo]:
        """Returns the services of all servers by name."""
        return all_services(self.servers().values())

    def actions(self) -> dict[str, ActionInfo]:
        """Returns the actions of all servers by name."""
        return all_actions(self.servers().values())

    def action(self, name: str) -> ActionInfo:
        """Returns the properties of an action.

        Raises:
            UnknownNameError: No server offers it.
        """
        full = self.resolve(name)
        for server in self._nearest(full):
            if full in server.actions:
                return server.actions[full]
        servers, silent = self._ask_all()
        found: ActionInfo = self._known("action", full, all_actions(servers.values()), silent)
        return found

    def topic(self, name: str) -> TopicInfo:
        """Returns the properties of a topic.

        Raises:
            UnknownNameError: No server has it.
        """
        servers, silent = self._ask_all()
        found: TopicInfo = self._known("topic", name, all_topics(servers.values(), _hidden(name)), silent)
        return found

    def service(self, name: str) -> ServiceInfo:
        """Returns the properties of a service.

        Raises:
            UnknownNameError: No server offers it.
        """
        full = self.resolve(name)
        for server in self._nearest(full):
            if full in server.every_service:
                return server.every_service[full]
        servers, silent = self._ask_all()
        found: ServiceInfo = self._known("service", full, all_services(servers.values(), _hidden(full)), silent)
        return found

    def resolve(self, name: str) -> str:
        """Returns the full name: `/clock` for `clock`, `/mjplug/epoch` for `~/epoch`.

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
        """Returns the class of a ROS type such as `std_msgs/msg/String`, or that of a topic, service or action.

        Args:
            type: The name of a type, or the name of a topic, service or action (`/clock`, `~/set_pause`).

        Raises:
            WrongTypeError: There is no class for the type.
            UnknownNameError: There is no such topic, service or action.
        """
        if not type.startswith(("/", "~")):
            return find(type)
        servers, silent = self._ask_all()
        every, hidden = servers.values(), _hidden(type)
        offered: dict[str, Any] = all_topics(every, hidden) | all_services(every, hidden) | all_actions(every)
        return find(self._known("topic, service or action", type, offered, silent).type)

    def wait_for(self, name: str, timeout: float = 10.0) -> TopicInfo | ServiceInfo | ActionInfo:
        """Waits until a topic, a service or an action exists.

        Args:
            name: Its name.
            timeout: How long to wait [s].

        Raises:
            TimedOutError: It did not appear in time.
        """
        until = time.monotonic() + bounded(timeout)
        while (found := self._there(name)) is None:
            if time.monotonic() >= until:
                raise TimedOutError(f"no topic, service or action {name} appeared within {timeout:g} s")
            time.sleep(_POLL)
        return found

    def _there(self, name: str) -> TopicInfo | ServiceInfo | ActionInfo | None:
        try:
            full = self.resolve(name)
        except NoServerError:
            # The server may start later.
            return None
        # `_everybody` logs no warnings about servers that do not answer.
        for server in (*self._nearest(full), *self._everybody()[0].values()):
            if found := server.every_topic.get(full) or server.every_service.get(full) or server.actions.get(full):
                return found
        return None

    def _names(self) -> tuple[str, ...]:
        try:
            return server_names(self.session)
        except NoAnswerError as error:
            raise self._no_answer(error) from None

    def _ask(self, name: str) -> ServerInfo:
        try:
            return parse(questions.ask(self.session, name))
        except NoAnswerError as error:
            raise NoServerError(str(error)) from None
        except UnreadableListError as error:
            raise ClientError(str(error)) from None

    def _everybody(self) -> tuple[dict[str, ServerInfo], dict[str, str]]:
        try:
            return questions.ask_all(self.session)
        except NoAnswerError as error:
            raise self._no_answer(error) from None

    def _no_answer(self, error: NoAnswerError) -> NoServerError:
        return NoServerError(f"{error} at {self.endpoint}: its server is stopped or overloaded")

    def _ask_all(self) -> tuple[dict[str, ServerInfo], tuple[str, ...]]:
        """Returns all servers that answer, and the names of announced servers that do not."""
        servers, silent = self._everybody()
        for name in silent.keys() - self._silent:
            _log.warning("%s; it is omitted", silent[name])
        self._silent = set(silent)
        return servers, tuple(silent)

    def _topics_for(self, full: str) -> tuple[dict[str, TopicInfo], tuple[str, ...]]:
        """Returns topics, including the one with this name if it exists, and the servers that did not answer."""
        for server in self._nearest(full):
            # Only the publisher determines the topic's quality of service.
            topics = server.every_topic if _hidden(full) else server.topics
            if full in topics and topics[full].publishers:
                return topics, ()
        servers, silent = self._ask_all()
        return all_topics(servers.values(), _hidden(full)), silent

    def _nearest(self, full: str) -> list[ServerInfo]:
        """Returns at most `_NEAREST` servers whose name or namespace is a prefix of a full name, the longest first.

        They are likely to have it. A query to them takes a millisecond, independent of the number of servers.
        """
        near: dict[str, int] = {}
        for name in self._names():
            for start in (name, name.rpartition("/")[0]):
                if start and full.startswith(f"{start}/"):
                    near[name] = max(near.get(name, 0), len(start))
        found = []
        for name in sorted(near, key=lambda name: -near[name])[:_NEAREST]:
            try:
                found.append(self._ask(name))
            except ClientError:
                # All servers are asked next, and those that do not answer are reported then.
                continue
        return found

    def _name(self) -> str:
        if self._server:
            return self._server
        there = self._names()
        if len(there) == 1:
            return there[0]
        if not there:
            raise NoServerError(f"no mjplug server is left on the network of {self.endpoint}")
        raise ClientError(
            f"there are several servers: {', '.join(there)}; choose one (connect(server=...), --server), "
            "or use full names"
        )

    def _known(
        self, kind: str, name: str, offered: dict[str, Any], silent: tuple[str, ...] = (), hint: str = ""
    ) -> Any:
        full = self.resolve(name)
        if full not in offered:
            raise UnknownNameError(kind, full, offered, silent, hint)
        return offered[full]


def _hidden(name: str) -> bool:
    """Returns whether a name is that of a part of an action."""
    return "/_action/" in name
