"""Finds the topics of all servers on a network, with their types and keys, and follows servers that start and stop."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import xxhash
import zenoh

from mjplug.bag.definitions import text_of
from mjplug.bag.errors import BagError
from mjplug.bag.topics import BagTopic
from mjplug.contracts.transport import DEFAULT, QoS
from mjplug.wire.discovery import questions
from mjplug.wire.discovery.announced import INTERFACES, TOKENS, NoAnswerError
from mjplug.wire.discovery.format import UnreadableListError
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import key, validate_name

_log = logging.getLogger(__name__)

_SETTLING = 0.1
"""Pause before servers are asked, because a server that starts changes its list many times [s]."""

_MAX_SERVERS = 1000
"""Maximum number of servers that are asked; any program can announce any number of them."""

_MAX_DEPTH = 10_000
"""Maximum number of messages that are requested from the history of a topic."""

_AGAIN = 2.0
"""Time after which a server that did not answer is asked again [s]."""


@dataclass(frozen=True, slots=True)
class Source:
    """A topic that can be recorded.

    Attributes:
        topic: The topic.
        keys: The Zenoh keys on which it is published, each once.
        published: Whether a server publishes it; otherwise servers only subscribe to it, and other programs publish.
    """

    topic: BagTopic
    keys: tuple[str, ...]
    published: bool


@dataclass(frozen=True, slots=True)
class ServiceSource:
    """A service of a server.

    Attributes:
        name: Its full name.
        type: Name of its type.
        key: Its Zenoh key.
        server: The server that offers it.
        request: Definition of the request with those of the types of its fields, in the format `ros2msg`.
        response: The same of the response.
    """

    name: str
    type: str
    key: str
    server: str
    request: str
    response: str


class Sources:
    """The topics of the network. Its own thread asks the servers.

    Attributes:
        known: Set when all servers have been asked for the first time.

    Args:
        session: The session.
        found: Called with each topic that was found, on the thread; again if a server publishes it only later.
        offered: Called with each service that was found, on the thread; None if services are not wanted.
    """

    def __init__(
        self,
        session: zenoh.Session,
        found: Callable[[Source], None],
        offered: Callable[[ServiceSource], None] | None = None,
    ) -> None:
        self.known = threading.Event()
        self._session = session
        self._found = found
        self._offered = offered
        self._lock = threading.Lock()
        self._hosts: dict[bytes, str] = {}
        self._dirty: set[str] = set()
        self._reported: set[tuple[str, str]] = set()
        self._wake = threading.Event()
        self._closed = False
        handler = zenoh.handlers.Callback(self._token, indirect=False)
        self._tokens = session.liveliness().declare_subscriber(f"{TOKENS}/**", handler, history=True)
        changed = zenoh.handlers.Callback(self._changed, indirect=False)
        self._changes = session.declare_subscriber(f"**/{INTERFACES}", changed)
        self._thread = threading.Thread(target=self._run, name="topics", daemon=True)
        self._thread.start()

    def server_of(self, host: bytes) -> str:
        """Returns the name of the server whose publishers have a host id; empty if there is none."""
        return self._hosts.get(host, "")

    @property
    def servers(self) -> list[str]:
        """The names of the servers that were seen."""
        return sorted({*self._hosts.values()})

    def close(self) -> None:
        """Ends the thread; a second call does nothing."""
        self._closed = True
        self._wake.set()
        self._thread.join(5.0)

    def _token(self, sample: zenoh.Sample) -> None:
        _, *middle, zid = str(sample.key_expr).split("/")
        name = f"/{'/'.join(middle)}"
        if sample.kind != zenoh.SampleKind.PUT or len(self._hosts) >= _MAX_SERVERS or not _valid(name):
            return
        with self._lock:
            # Kept after the end of the server, whose last messages may arrive later.
            self._hosts[xxhash.xxh3_64_digest(f"{zid}{name}".encode())] = name
            self._dirty.add(name)
        self._wake.set()

    def _changed(self, sample: zenoh.Sample) -> None:
        name = "/" + str(sample.key_expr).removesuffix(f"/{INTERFACES}")
        with self._lock:
            if name in self._hosts.values():
                self._dirty.add(name)
                self._wake.set()

    def _run(self) -> None:
        timeout: float | None = _SETTLING
        while not self._closed:
            self._wake.wait(timeout)
            self._wake.clear()
            # `set` may come before the first token.
            threading.Event().wait(_SETTLING)
            with self._lock:
                dirty, self._dirty = self._dirty, set()
            failed = {name for name in sorted(dirty) if not self._closed and not self._ask(name)}
            with self._lock:
                self._dirty |= failed
            timeout = _AGAIN if failed else None
            self.known.set()

    def _ask(self, name: str) -> bool:
        """Asks a server for its topics; returns whether it need not be asked again."""
        try:
            listing = questions.ask(self._session, name, schema=True)
        except (NoAnswerError, UnreadableListError, zenoh.ZError) as error:
            _log.debug("%s", error)
            return False
        definitions = {type: str(entry.get("definition", "")) for type, entry in listing.get("types", {}).items()}
        published = {entry["name"] for entry in listing["topics"] if entry["direction"] == "published"}
        for entry in listing["topics"]:
            if (entry["name"] in published) == (entry["direction"] == "published"):
                self._report(name, entry, definitions)
        if self._offered is not None:
            for entry in listing["services"]:
                self._report_service(self._offered, name, entry, definitions)
        return True

    def _report_service(
        self, offered: Callable[[ServiceSource], None], server: str, entry: dict[str, Any], definitions: dict[str, str]
    ) -> None:
        type, key_ = entry["type"], str(entry["key"])
        request, _, response = f"\n{definitions.get(type, '')}".partition("\n---\n")
        try:
            texts = [
                text_of(f"{type}{part}", definitions | {f"{type}{part}": text})
                for part, text in (("_Request", request.removeprefix("\n")), ("_Response", response))
            ]
        except BagError as error:
            _log.debug("service %s of %s: %s", entry["name"], server, error)
            return
        offered(ServiceSource(entry["name"], type, key_, server, *texts))

    def _report(self, server: str, entry: dict[str, Any], definitions: dict[str, str]) -> None:
        published = entry["direction"] == "published"
        try:
            text = text_of(entry["type"], definitions)
        except BagError as error:
            if (server, entry["name"]) not in self._reported:
                self._reported.add((server, entry["name"]))
                _log.warning("topic %s of %s cannot be recorded: %s", entry["name"], server, error)
            return
        topic = BagTopic(entry["name"], entry["type"], text, str(entry.get("hash", "")), _qos(entry["qos"]))
        keys = [key(entry["name"])]
        if not published:
            # Other programs may publish commands in any of the forms that the server accepts.
            keys += [entry[field] for field in ("json_key", "ros2_key") if isinstance(entry.get(field), str)]
        self._found(Source(topic, tuple(dict.fromkeys(keys)), published))


def _qos(values: Any) -> QoS:
    """Returns the quality of service in a list; any program can send one, so that unknown values become the default."""
    depth = values.get("depth")
    return QoS(
        depth if isinstance(depth, int) and 0 < depth <= _MAX_DEPTH else DEFAULT.depth,
        "best_effort" if values.get("reliability") == "best_effort" else "reliable",
        "transient_local" if values.get("durability") == "transient_local" else "volatile",
    )


def _valid(name: str) -> bool:
    try:
        validate_name(name)
    except NameRuleError:
        return False
    return True
