"""What servers offer, as their `interfaces` queryables tell it."""

import json
import re
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import zenoh

from mjplug.client.errors import ClientError, NoServerError
from mjplug.client.timeouts import AT_ONCE
from mjplug.errors import quoted
from mjplug.wire.encoding import MAX_KEY
from mjplug.wire.identity import TOKENS
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import key, validate_name

QUERY_TIMEOUT = 2.0
"""How long to wait for a server's list [s]; it takes a millisecond, and a slow network somewhat longer."""

_ATTEMPTS = 2
"""How often servers that are announced are asked before they are reported as not answering."""

_RETRY = 0.1
"""Pause between two attempts [s]."""

_MOST_ASKED = 200
"""How many servers are asked one by one at most; any program can announce any number of them."""

_TYPE = re.compile(r"[A-Za-z0-9_]+/(msg|srv)/[A-Za-z0-9_]+")


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """A topic, and who of the servers is at its ends.

    Attributes:
        name: Its full name, such as `/clock`.
        type: The name of its type, such as `rosgraph_msgs/msg/Clock`.
        hash: The RIHS01 hash of the type.
        key: Its Zenoh key for CDR.
        json_key: Its Zenoh key for JSON.
        reliability: `reliable` or `best_effort`.
        durability: `volatile`, or `transient_local` for a latched topic.
        depth: How many messages are kept for a slow or late subscriber.
        publishers: The servers that publish it.
        subscribers: The servers that read it.
    """

    name: str
    type: str
    hash: str
    key: str
    json_key: str
    reliability: str
    durability: str
    depth: int
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]

    @property
    def latched(self) -> bool:
        """Whether those who subscribe late still get the last messages."""
        return self.durability == "transient_local"


@dataclass(frozen=True, slots=True)
class ServiceInfo:
    """A service.

    Attributes:
        name: Its full name, such as `/mjplug/set_pause`.
        type: The name of its type.
        hash: The RIHS01 hash of the type.
        key: Its Zenoh key.
        server: The server that offers it.
    """

    name: str
    type: str
    hash: str
    key: str
    server: str


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """A server and what it offers.

    Attributes:
        name: Its full name, such as `/mjplug`.
        version: Its version of mjplug.
        endpoint: Where clients on its machine connect.
        topics: Its topics by name.
        services: Its services by name.
    """

    name: str
    version: str
    endpoint: str
    topics: dict[str, TopicInfo]
    services: dict[str, ServiceInfo]


def server_names(session: zenoh.Session, timeout: float = QUERY_TIMEOUT) -> tuple[str, ...]:
    """Returns the full names of all servers on the network, in alphabetical order."""
    names = set()
    for reply in session.liveliness().get(f"{TOKENS}/**", timeout=timeout):
        if reply.ok is not None:
            # @mjplug/<namespace>/<node name>/<Zenoh id>
            name = "/" + "/".join(str(reply.ok.key_expr).split("/")[1:-1])
            try:
                validate_name(name)
            except NameRuleError:
                # No server can have this name; any program can declare such a token.
                continue
            names.add(name)
    return tuple(sorted(names))


def ask_all(session: zenoh.Session) -> tuple[dict[str, ServerInfo], dict[str, str]]:
    """Asks all servers of the network at once what they offer.

    Returns:
        What servers offer, by name, and why others that are announced are missing, by name. A server that has stopped
        meanwhile is in neither.
    """
    found: dict[str, ServerInfo] = {}
    failed: dict[str, str] = {}
    announced = set(server_names(session))
    for attempt in range(_ATTEMPTS):
        if announced <= found.keys():
            break
        if attempt:
            time.sleep(_RETRY)
            announced &= set(server_names(session))
        began = time.monotonic()
        # Again, each by its own key: access control may permit that, but not the wildcard.
        missing = sorted(announced - found.keys())[:_MOST_ASKED]
        selectors = [f"{key(name)}/interfaces" for name in missing] if attempt else ["**/interfaces"]
        queries = [
            session.get(s, target=zenoh.QueryTarget.ALL, consolidation=AT_ONCE, timeout=QUERY_TIMEOUT)
            for s in selectors
        ]
        for reply in chain.from_iterable(queries):
            if reply.ok is None:
                # Services of ROS 2 nodes match the wildcard too, and refuse.
                continue
            name = "/" + str(reply.ok.key_expr).removesuffix("/interfaces")
            if name in announced and name not in found:
                try:
                    found[name] = read(name, reply.ok.payload.to_bytes())
                except ClientError as error:
                    failed[name] = str(error)
            if announced <= found.keys():
                # A program that is no server may match the key too, and never answer.
                break
        waited = time.monotonic() - began
        for name in announced - found.keys():
            failed.setdefault(name, f"server {name} is announced but did not answer within {max(waited, 0.01):.2g} s")
    # A router asks everybody whom it knows at once.
    present = {name: found[name] for name in sorted(found)}
    return present, {name: why for name, why in sorted(failed.items()) if name in announced and name not in found}


def ask(session: zenoh.Session, name: str, schema: bool = False) -> dict[str, Any]:
    """Returns a server's own words about what it offers.

    Args:
        session: A session on its network.
        name: The server's full name.
        schema: Whether the definition and JSON Schema of each type should be there, under `types`.

    Raises:
        NoServerError: It does not answer.
        ClientError: What it answers is no list of interfaces.
    """
    selector = f"{key(name)}/interfaces{'?schema=true' if schema else ''}"
    for reply in session.get(selector, consolidation=AT_ONCE, timeout=QUERY_TIMEOUT):
        if reply.ok is not None:
            return _told(name, reply.ok.payload.to_bytes())
        assert reply.err is not None
        raise ClientError(f"server {name} cannot tell what it offers: {reply.err.payload.to_string()}")
    raise NoServerError(f"server {name} does not answer; it may just have stopped")


def read(name: str, answer: bytes) -> ServerInfo:
    """Returns what a server offers.

    Args:
        name: Its full name.
        answer: What it answered, as JSON text.

    Raises:
        ClientError: This is no list of interfaces of the server.
    """
    return parse(_told(name, answer))


def _told(name: str, answer: bytes) -> dict[str, Any]:
    """Returns an answer, checked: any program can answer, and names and types are printed and used as keys."""
    try:
        told: dict[str, Any] = json.loads(answer)
        if told["name"] != name:
            raise ValueError(f"the name in it is {told['name']!r}")
        for entry in (*told["topics"], *told["services"]):
            validate_name(entry["name"])
            if not _TYPE.fullmatch(entry["type"]):
                raise ValueError(f"{quoted(entry['type'])} is not the name of a type")
            for field in ("key", "json_key"):
                if len(entry.get(field, "").encode()) > MAX_KEY:
                    # Zenoh would panic when a request is sent to it.
                    raise ValueError(f"the key {quoted(entry[field])} is longer than {MAX_KEY} bytes")
        parse(told)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, NameRuleError) as error:
        raise ClientError(f"server {name} does not tell what it offers in a form that can be read: {error!r}") from None
    return told


def parse(told: dict[str, Any]) -> ServerInfo:
    """Returns what a server told about itself."""
    name = told["name"]
    topics: dict[str, TopicInfo] = {}
    for entry in told["topics"]:
        qos = entry["qos"]
        topic = TopicInfo(
            name=entry["name"],
            type=entry["type"],
            hash=entry["hash"],
            key=entry["key"],
            json_key=entry["json_key"],
            reliability=qos["reliability"],
            durability=qos["durability"],
            depth=qos["depth"],
            publishers=(name,) if entry["direction"] == "published" else (),
            subscribers=(name,) if entry["direction"] == "subscribed" else (),
        )
        topics[topic.name] = _joined(topics.get(topic.name), topic)
    services = (
        ServiceInfo(**{f: e[f] for f in ("name", "type", "hash", "key")}, server=name) for e in told["services"]
    )
    return ServerInfo(name, told["version"], told["endpoint"], topics, {service.name: service for service in services})


def all_topics(servers: Iterable[ServerInfo]) -> dict[str, TopicInfo]:
    """Returns the topics of several servers by name, in alphabetical order."""
    found: dict[str, TopicInfo] = {}
    for server in servers:
        for name, topic in server.topics.items():
            found[name] = _joined(found.get(name), topic)
    return dict(sorted(found.items()))


def all_services(servers: Iterable[ServerInfo]) -> dict[str, ServiceInfo]:
    """Returns the services of several servers by name, in alphabetical order."""
    return dict(sorted((name, service) for server in servers for name, service in server.services.items()))


def _joined(first: TopicInfo | None, second: TopicInfo) -> TopicInfo:
    """Returns one topic for two entries of its name; a publisher's quality of service is the topic's."""
    if first is None:
        return second
    main, other = (second, first) if second.publishers and not first.publishers else (first, second)
    return replace(
        main,
        publishers=tuple(dict.fromkeys((*main.publishers, *other.publishers))),
        subscribers=tuple(dict.fromkeys((*main.subscribers, *other.subscribers))),
    )
