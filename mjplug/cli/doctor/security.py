"""What a running server lets whom do, tried from outside and without changing anything.

A service is called with a request that is no request: a server that lets it in refuses it, and changes nothing. A topic
is published to with text that is no message. In place of the server, only the empty message is published that says that
the list of interfaces may have changed; a subscriber then reads the list again.
"""

import queue
import re
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Literal

import zenoh
from zenoh.handlers import Callback

from mjplug.cli.doctor.network import listens
from mjplug.client import Client, ClientError, NoServerError, connect
from mjplug.security.expiry import day, expiry_of
from mjplug.wire.access import READ_ONLY, READ_ONLY_NAMES
from mjplug.wire.discovery.format import ServerInfo
from mjplug.wire.handshake import ENCRYPTED, server_certificate
from mjplug.wire.zenoh_file import certificate, embedded, own_settings, read_zenoh_file, setting
from mjplug_schemas import names

_ANSWER_TIMEOUT = 2.0
"""How long to wait for what may never come [s]."""

_NO_REQUEST = b"\xff"
"""One byte, which is no request of any type."""

_ADDRESS = re.compile(r"(?:tls|quic)/(?P<host>\[[^\]]*\]|[^:/?#]+):(?P<port>\d+)")

State = Literal["open", "closed", "unknown", "valid", "expired"]


@dataclass(frozen=True, slots=True)
class Door:
    """One thing that was tried.

    Attributes:
        who: As whom: `nobody`, or the name of the Zenoh file.
        door: What was tried.
        state: Whether it worked; `unknown` if it could not be tried. A certificate is valid or expired.
        fault: Whether it should not have worked.
        note: More about it.
    """

    who: str
    door: str
    state: State
    fault: bool = False
    note: str = ""


def check_security(endpoint: str, file: Path | None) -> Iterator[Door]:
    """Yields each door of the servers at an endpoint, first for a client without a certificate or password.

    Args:
        endpoint: Where the server listens.
        file: The Zenoh file of a client to try the doors with; None tries them without one only.

    Raises:
        ClientError: Nobody listens there, or the file cannot be used.
    """
    if not listens(endpoint):
        raise NoServerError(f"nobody listens at {endpoint}; start a server there, or give its endpoint with --connect")
    encrypted = endpoint.startswith(ENCRYPTED)
    yield Door("anybody", "read the traffic on the network", _state(not encrypted), not encrypted)
    yield from _certificates(endpoint, file)
    role = "" if file is None else str(own_settings(_read(file)).get("role", ""))
    with _without_identity(file) as bare, _client(endpoint, bare) as nobody, _client(endpoint, file) as known:
        witness = file if isinstance(known, Client) else bare
        if isinstance(nobody, Client):
            yield Door("nobody", "connect", "open", True)
            yield from _doors("nobody", nobody, witness, "nobody")
        elif encrypted and bare is None:
            yield Door("nobody", "connect", "unknown", note="needs a file with the authority: --zenoh-config FILE")
        else:
            yield Door("nobody", "connect", "closed")
        if file is None:
            return
        if isinstance(known, Client):
            yield Door(file.name, "connect", "open")
            yield from _doors(file.name, known, witness, role)
        else:
            yield Door(file.name, "connect", "closed", note=known)


def _doors(who: str, client: Client, witness: Path | None, role: str) -> Iterator[Door]:
    """Yields the doors of each server.

    Args:
        who: As above.
        client: Tries them.
        witness: The file of a second client, which hears what comes through.
        role: What the client is meant to be: `nobody`, `viewer`, `operator`, or empty if that is not known.
    """
    with connect(client.endpoint, timeout=0.0, config=witness) as second:
        for name, server in second.servers().items():
            yield from _doors_of(name, server, who, client, second, role)


def _doors_of(name: str, server: ServerInfo, who: str, client: Client, second: Client, role: str) -> Iterator[Door]:
    published = [topic for topic in server.topics.values() if name in topic.publishers]
    subscribed = [topic for topic in server.topics.values() if name in topic.subscribers]
    for topic in published:
        if topic.name == "/clock":
            heard = _hears(client, topic.key)
            yield Door(who, f"hear {topic.name}", _state(heard), heard and role == "nobody", _paused(heard))
    for service in server.services.values():
        reads = service.type in READ_ONLY or service.name in {f"{name}/{own}" for own in READ_ONLY_NAMES}
        called = _answers(client, service.key)
        fault = called and (role == "nobody" or (role == "viewer" and not reads))
        yield Door(who, f"call {service.name}", _state(called), fault)
    for topic in subscribed:
        sent = _arrives(client, second, topic.json_key, b"no message")
        yield Door(who, f"publish to {topic.name}", _state(sent), sent and role in ("nobody", "viewer"))
    spoofed = _arrives(client, second, f"{names.key(name)}/interfaces", b"")
    yield Door(who, f"publish in place of {name}", _state(spoofed), spoofed)
    served = _serves(client, second, f"{names.key(name)}/doctor_{uuid.uuid4().hex}")
    yield Door(who, f"offer a service of {name}", _state(served), served)


def _certificates(endpoint: str, file: Path | None) -> Iterator[Door]:
    match = _ADDRESS.match(endpoint)
    shown = None
    if match is not None and endpoint.startswith("tls/"):
        shown = server_certificate(match["host"].strip("[]"), int(match["port"]))
    own = None
    if file is not None:
        own = certificate(_read(file), file, "connect")
    for who, pem in (("server", shown), (file.name if file is not None else "", own)):
        until = expiry_of(pem) if pem is not None else None
        if until is not None:
            valid = until > datetime.now(UTC)
            yield Door(who, "certificate", "valid" if valid else "expired", note=f"expires {day(until)}")


@contextmanager
def _client(endpoint: str, file: Path | None) -> Iterator[Client | str]:
    """Connects; gives the reason where that does not work."""
    try:
        client = connect(endpoint, timeout=0.0, config=file)
    except ClientError as error:
        yield str(error)
        return
    with client:
        yield client


def _hears(client: Client, key: str) -> bool:
    heard: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    with client.session.declare_subscriber(key, Callback(heard.put, indirect=False)):
        return _comes(heard)


def _answers(client: Client, key: str) -> bool:
    """Whether a service answers at all; that it refuses is an answer."""
    encoding = zenoh.Encoding.APPLICATION_CDR
    return any(True for _ in client.session.get(key, payload=_NO_REQUEST, encoding=encoding, timeout=_ANSWER_TIMEOUT))


def _arrives(client: Client, second: Client, key: str, payload: bytes) -> bool:
    """Whether what one client publishes arrives at a second one, through the server."""
    mark = uuid.uuid4().bytes

    def put() -> None:
        client.session.put(key, payload, attachment=mark, congestion_control=zenoh.CongestionControl.BLOCK)

    heard: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()

    def take(sample: zenoh.Sample) -> None:
        if sample.attachment is not None and sample.attachment.to_bytes() == mark:
            heard.put(sample)

    with second.session.declare_subscriber(key, Callback(take, indirect=False)):
        return _comes(heard, again=put)


def _serves(client: Client, second: Client, key: str) -> bool:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, b"")

    with client.session.declare_queryable(key, Callback(answer, indirect=False)):
        until = monotonic() + _ANSWER_TIMEOUT
        while monotonic() < until:
            if any(reply.ok is not None for reply in second.session.get(key, timeout=_ANSWER_TIMEOUT)):
                return True
            sleep(_ANSWER_TIMEOUT / 10)
    return False


@contextmanager
def _without_identity(file: Path | None) -> Iterator[Path | None]:
    """Gives a file with the authority that another file trusts, and nothing else of it; None where it trusts none."""
    if file is None:
        yield None
        return
    named = setting(_read(file), "transport/link/tls/root_ca_certificate")
    authority = Path(named).read_text() if isinstance(named, str) else embedded(file, "root_ca_certificate_base64")
    if authority is None:
        yield None
        return
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "authority.pem").write_text(authority)
        bare = Path(folder, "nobody.json5")
        bare.write_text('{"transport": {"link": {"tls": {"root_ca_certificate": "authority.pem"}}}}')
        yield bare


def _read(file: Path) -> zenoh.Config:
    try:
        return read_zenoh_file(file)
    except zenoh.ZError as error:
        raise ClientError(f"cannot use the Zenoh configuration file {file}: {error}") from None


def _comes(heard: "queue.SimpleQueue[Any]", again: Callable[[], None] | None = None) -> bool:
    """Whether something comes; `again` is called until it does."""
    for _ in range(10):
        if again is not None:
            again()
        try:
            heard.get(timeout=_ANSWER_TIMEOUT / 10)
        except queue.Empty:
            continue
        return True
    return False


def _state(works: bool) -> State:
    return "open" if works else "closed"


def _paused(heard: bool) -> str:
    return "" if heard else "nothing comes while the simulation is paused"
