"""Tests what clients are allowed to do with a running server, without changing anything.

Services are called with an invalid request, and topics get an invalid message; a server that gets them refuses them.
In place of the server, only the empty message is published that reports a possible change of the list of interfaces;
subscribers then read the list again.
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
"""How long to wait for a message or an answer that may never come [s]."""

_INVALID_REQUEST = b"\xff"
"""One byte, which is not a valid request of any type."""

_ADDRESS = re.compile(r"(?:tls|quic)/(?P<host>\[[^\]]*\]|[^:/?#]+):(?P<port>\d+)")

ANONYMOUS = "anonymous"
"""A client without a certificate and without a password."""

Result = Literal["allowed", "denied", "unknown", "valid", "expired"]


@dataclass(frozen=True, slots=True)
class Attempt:
    """One action that a client tried.

    Attributes:
        client: `anonymous`, or the name of the client's Zenoh file; for certificates also `server`.
        action: The action.
        result: Whether the action was allowed; `unknown` if it could not be tried. A certificate is valid or expired.
        fault: Whether the action was allowed and should be denied.
        note: Further information; may be empty.
    """

    client: str
    action: str
    result: Result
    fault: bool = False
    note: str = ""


def check_security(endpoint: str, file: Path | None) -> Iterator[Attempt]:
    """Tries actions at the servers of an endpoint, first as an anonymous client.

    Args:
        endpoint: The endpoint of the server.
        file: The Zenoh file of a second client, which tries the same actions; None means no second client.

    Raises:
        ClientError: No program listens there, or the file cannot be used.
    """
    if not listens(endpoint):
        raise NoServerError(
            f"no program listens at {endpoint}; start a server there, or give its endpoint with --connect"
        )
    encrypted = endpoint.startswith(ENCRYPTED)
    yield Attempt(ANONYMOUS, "read the traffic on the network", _result(not encrypted), not encrypted)
    yield from _certificates(endpoint, file)
    role = "" if file is None else str(own_settings(_read(file)).get("role", ""))
    with _without_identity(file) as bare, _client(endpoint, bare) as anonymous, _client(endpoint, file) as known:
        witness = file if isinstance(known, Client) else bare
        if isinstance(anonymous, Client):
            yield Attempt(ANONYMOUS, "connect", "allowed", True)
            yield from _attempts(ANONYMOUS, anonymous, witness, ANONYMOUS)
        elif encrypted and bare is None:
            yield Attempt(
                ANONYMOUS, "connect", "unknown", note="needs a file with the certificate authority: --zenoh-config FILE"
            )
        else:
            yield Attempt(ANONYMOUS, "connect", "denied")
        if file is None:
            return
        if isinstance(known, Client):
            yield Attempt(file.name, "connect", "allowed")
            yield from _attempts(file.name, known, witness, role)
        else:
            yield Attempt(file.name, "connect", "denied", note=known)


def _attempts(who: str, client: Client, witness: Path | None, role: str) -> Iterator[Attempt]:
    """Tries actions at each server.

    Args:
        who: As `Attempt.client`.
        client: The client that tries them.
        witness: The Zenoh file of another client, which checks whether messages arrive.
        role: The role of the client: `anonymous`, `viewer`, `operator`, or empty if it is not known.
    """
    with connect(client.endpoint, timeout=0.0, config=witness) as second:
        for name, server in second.servers().items():
            yield from _attempts_at(name, server, who, client, second, role)


def _attempts_at(
    name: str, server: ServerInfo, who: str, client: Client, second: Client, role: str
) -> Iterator[Attempt]:
    published = [topic for topic in server.topics.values() if name in topic.publishers]
    subscribed = [topic for topic in server.topics.values() if name in topic.subscribers]
    for topic in published:
        if topic.name == "/clock":
            received = _receives(client, topic.key)
            yield Attempt(
                who, f"receive {topic.name}", _result(received), received and role == ANONYMOUS, _paused(received)
            )
    for service in server.services.values():
        reads = service.type in READ_ONLY or service.name in {f"{name}/{own}" for own in READ_ONLY_NAMES}
        called = _answers(client, service.key)
        fault = called and (role == ANONYMOUS or (role == "viewer" and not reads))
        yield Attempt(who, f"call {service.name}", _result(called), fault)
    for topic in subscribed:
        sent = _arrives(client, second, topic.json_key, b"invalid")
        yield Attempt(who, f"publish to {topic.name}", _result(sent), sent and role in (ANONYMOUS, "viewer"))
    spoofed = _arrives(client, second, f"{names.key(name)}/interfaces", b"")
    yield Attempt(who, f"publish in place of {name}", _result(spoofed), spoofed)
    served = _serves(client, second, f"{names.key(name)}/doctor_{uuid.uuid4().hex}")
    yield Attempt(who, f"provide a service of {name}", _result(served), served)


def _certificates(endpoint: str, file: Path | None) -> Iterator[Attempt]:
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
            yield Attempt(who, "certificate", "valid" if valid else "expired", note=f"expires {day(until)}")


@contextmanager
def _client(endpoint: str, file: Path | None) -> Iterator[Client | str]:
    """Yields a connected client, or the reason if it cannot connect."""
    try:
        client = connect(endpoint, timeout=0.0, config=file)
    except ClientError as error:
        yield str(error)
        return
    with client:
        yield client


def _receives(client: Client, key: str) -> bool:
    received: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    with client.session.declare_subscriber(key, Callback(received.put, indirect=False)):
        return _gets_one(received)


def _answers(client: Client, key: str) -> bool:
    """Returns whether a service answers; a refusal is an answer too."""
    encoding = zenoh.Encoding.APPLICATION_CDR
    return any(
        True for _ in client.session.get(key, payload=_INVALID_REQUEST, encoding=encoding, timeout=_ANSWER_TIMEOUT)
    )


def _arrives(client: Client, second: Client, key: str, payload: bytes) -> bool:
    """Returns whether a message of one client arrives at a second one, through the server."""
    mark = uuid.uuid4().bytes

    def put() -> None:
        client.session.put(key, payload, attachment=mark, congestion_control=zenoh.CongestionControl.BLOCK)

    received: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()

    def take(sample: zenoh.Sample) -> None:
        if sample.attachment is not None and sample.attachment.to_bytes() == mark:
            received.put(sample)

    with second.session.declare_subscriber(key, Callback(take, indirect=False)):
        return _gets_one(received, again=put)


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
    """Yields a file with only the certificate authority of another file; None if that file names no authority."""
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
        bare = Path(folder, "anonymous.json5")
        bare.write_text('{"transport": {"link": {"tls": {"root_ca_certificate": "authority.pem"}}}}')
        yield bare


def _read(file: Path) -> zenoh.Config:
    try:
        return read_zenoh_file(file)
    except zenoh.ZError as error:
        raise ClientError(f"cannot use the Zenoh configuration file {file}: {error}") from None


def _gets_one(received: "queue.SimpleQueue[Any]", again: Callable[[], None] | None = None) -> bool:
    """Returns whether an item arrives in time; `again` is called until then."""
    for _ in range(10):
        if again is not None:
            again()
        try:
            received.get(timeout=_ANSWER_TIMEOUT / 10)
        except queue.Empty:
            continue
        return True
    return False


def _result(works: bool) -> Result:
    return "allowed" if works else "denied"


def _paused(received: bool) -> str:
    return "" if received else "no messages are published while the simulation is paused"
