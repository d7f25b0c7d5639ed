"""Warns about topics, services and actions that two servers on one network have under the same name.

Each server declares a second liveliness token, `@mjplug/<namespace>/<node_name>/<Zenoh id>/@ready`, after everything
else is declared. A server that sees this token of another one queries its interfaces, once. So both servers log the
warning, in whatever order they start, and also if their networks are joined later.
"""

import json
import logging
import queue
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import zenoh

from mjplug.errors import quoted
from mjplug.log_scope import bound
from mjplug.wire.callbacks import callback
from mjplug.wire.discovery.announced import AT_ONCE, TOKENS, interfaces_key
from mjplug.wire.discovery.answers import Listing
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import validate_name

READY = "@ready"
"""Last chunk of the token; a verbatim chunk, which `@mjplug/**` does not match."""

BY_CONVENTION = ("rcl_interfaces/msg/Log", "rcl_interfaces/msg/ParameterEvent", "diagnostic_msgs/msg/DiagnosticArray")
"""Types of topics that many ROS nodes publish together; each message names its sender."""

TRANSFORMS = "tf2_msgs/msg/TFMessage"
"""Servers may share a topic of transforms if their frames have different prefixes."""

_ANSWER_TIMEOUT = 2.0
"""Timeout of the query for the interfaces of another server [s]; it takes milliseconds."""

_MAX_ANSWER = 1 << 20
"""Maximum size of a list of interfaces that is decoded [bytes]; about 2500 topics."""

_MAX_COMMAS = 50_000
"""Maximum number of commas in a list that is decoded: physics waits while JSON is decoded, value by value."""

_MAX_SERVERS = 200
"""Maximum number of tokens that are handled; any program on the network can declare any number of them."""

_MAX_WARNINGS = 400
"""Maximum number of warnings; a program that changes its list for ever must not fill the log."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SharedNames:
    """Topics, services and actions that two servers have under the same name.

    Attributes:
        published: Topics that both publish.
        subscribed: Topics that both subscribe to.
        services: Services that both offer.
        actions: Actions that both offer.
    """

    published: tuple[str, ...]
    subscribed: tuple[str, ...]
    services: tuple[str, ...]
    actions: tuple[str, ...] = ()

    def sentence(self, own: str, other: str) -> str:
        """Returns the warning for the server named `own`; empty if nothing is shared."""
        parts = [
            f"{what} {', '.join(names)}"
            for what, names in (
                ("both publish", self.published),
                ("both subscribe to", self.subscribed),
                ("both offer the service", self.services),
                ("both offer the action", self.actions),
            )
            if names
        ]
        if not parts:
            return ""
        ways = []
        if own.rpartition("/")[0] == other.rpartition("/")[0]:
            ways.append(
                "give one of them another namespace, such as --set namespace=robot2, which moves all names that "
                "are not absolute"
            )
            absolute = [name for name in self.published if name == "/clock"]
        else:
            absolute = [*self.published, *self.subscribed, *self.services, *self.actions]
        if absolute:
            # Without a namespace, `{ns}` changes nothing.
            where = next((f"in {a}, " for a, b in ((own, other), (other, own)) if b.count("/") == 1 < a.count("/")), "")
            ways.append(
                f"{where}give absolute names a place in the namespace, such as "
                f"--set 'remap.{absolute[0]}={{ns}}{absolute[0]}'"
            )
        return f"this server and {other} on the same network use the same names: {'; '.join(parts)}. " + (
            f"Clients cannot tell the two apart: {', and '.join(ways)}"
        )


def shared_names(listing: Listing, other: Any, exempt: Iterable[str] = ()) -> SharedNames:
    """Returns the names that a server shares with another one.

    Args:
        listing: The server's own interfaces.
        other: The interfaces of the other server, as decoded from its JSON; the content may be invalid.
        exempt: Types of topics that both may publish.
    """
    theirs: dict[str, set[str]] = {"published": set(), "subscribed": set()}
    for entry in other["topics"]:
        theirs[entry["direction"]].add(entry["name"])
    offered = {entry["name"] for entry in other["services"]}
    # Servers of earlier versions list no actions.
    goals = {entry["name"] for entry in other.get("actions", ())}
    ours = [(entry.direction, entry.topic) for entry in listing.topics]
    fine = {*BY_CONVENTION, *exempt}
    return SharedNames(
        _in_order(t.name for d, t in ours if d == "published" and t.name in theirs[d] and t.type.TYPE not in fine),
        _in_order(t.name for d, t in ours if d == "subscribed" and t.name in theirs[d]),
        _in_order(entry.service.name for entry in listing.services if entry.service.name in offered),
        _in_order(entry.action.name for entry in listing.actions if entry.action.name in goals),
    )


class SharedNamesWatch:
    """Declares that a server is ready, and logs a warning about names that it shares with other servers.

    Args:
        session: The server's session.
        listing: Returns the server's interfaces; all of them must be declared.
        exempt: Types of topics that are not reported.
    """

    def __init__(self, session: zenoh.Session, listing: Callable[[], Listing], exempt: Iterable[str] = ()) -> None:
        self._session = session
        self._listing = listing
        self._exempt = tuple(exempt)
        self._own = str(session.zid())
        self._seen: set[str] = set()
        self._reported: dict[str, str] = {}
        self._warnings = 0
        self._waiting: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        # This thread sends the queries and waits for replies, because Zenoh's threads must not wait.
        self._thread = threading.Thread(target=bound(self._run), name="shared names", daemon=True)
        self._thread.start()
        liveliness = session.liveliness()
        self._token = liveliness.declare_token(f"{TOKENS}{listing().name}/{self._own}/{READY}")
        handler = callback(self._appeared)
        self._subscriber = liveliness.declare_subscriber(f"{TOKENS}/**/{READY}", handler, history=True)

    def close(self) -> None:
        """Stops the watch; a second call does nothing."""
        self._waiting.put(None)
        self._thread.join(_ANSWER_TIMEOUT)

    def _appeared(self, sample: zenoh.Sample) -> None:
        token = str(sample.key_expr)
        if sample.kind != zenoh.SampleKind.PUT:
            self._seen.discard(token)
        elif token not in self._seen and len(self._seen) < _MAX_SERVERS and self._waiting.qsize() < _MAX_SERVERS:
            self._seen.add(token)
            self._waiting.put(token)

    def _run(self) -> None:
        while (token := self._waiting.get()) is not None:
            name, holder = _parts(token)
            if holder == self._own or name == self._listing().name:
                # `identity.claim` reports another server of the same name.
                continue
            try:
                validate_name(name)
                self._compare(name)
            except NameRuleError:
                # This is not the token of a server.
                continue
            except zenoh.ZError as error:
                _log.debug("querying the interfaces of server %s failed: %s", name, error)

    def _compare(self, name: str) -> None:
        for reply in self._session.get(interfaces_key(name), consolidation=AT_ONCE, timeout=_ANSWER_TIMEOUT):
            if reply.ok is None:
                continue
            try:
                found = shared_names(self._listing(), _decoded(reply.ok.payload), self._exempt)
            except (ValueError, KeyError, TypeError, RecursionError) as error:
                # A KeyError contains text from the reply.
                reason = quoted(str(error)) if isinstance(error, KeyError) else error
                self._warn(name, f"server {name} on this network replied with an invalid list of interfaces: {reason}")
                return
            self._warn(name, found.sentence(self._listing().name, name))
            return

    def _warn(self, name: str, sentence: str) -> None:
        """Logs a warning about a server, unless it is empty or was the last one about this server."""
        # A restart of the other server does not repeat the warning.
        if not sentence or self._reported.get(name) == sentence or self._warnings >= _MAX_WARNINGS:
            return
        self._warnings += 1
        self._reported[name] = sentence
        more = "" if self._warnings < _MAX_WARNINGS else " (no more warnings of this kind are logged)"
        _log.warning("%s%s", sentence, more)


def _decoded(payload: zenoh.ZBytes) -> Any:
    """Returns the content of a reply.

    Raises:
        ValueError: The reply is not JSON, or too large.
    """
    if len(payload) > _MAX_ANSWER:
        raise ValueError(f"it has {len(payload)} bytes; at most {_MAX_ANSWER} are decoded")
    text = payload.to_bytes()
    if (commas := text.count(b",")) > _MAX_COMMAS:
        raise ValueError(f"it contains {commas} commas; at most {_MAX_COMMAS} are accepted")
    return json.loads(text)


def _parts(token: str) -> tuple[str, str]:
    """Returns the server's name and Zenoh id in a token."""
    name, _, holder = token.removeprefix(TOKENS).removesuffix(f"/{READY}").rpartition("/")
    return name, holder


def _in_order(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(set(names)))
