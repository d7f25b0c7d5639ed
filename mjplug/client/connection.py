"""Gets a client onto a server's network, or says why it cannot."""

import json
import os
import re
import time
from pathlib import Path

import zenoh

from mjplug.client.client import Client
from mjplug.client.errors import ClientError, NoServerError, UnknownNameError
from mjplug.client.listing import server_names
from mjplug.client.refusal import refuse_expired, why_refused
from mjplug.client.timeouts import bounded
from mjplug.wire.zenoh_file import read_zenoh_file, setting

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where a server listens unless it is told otherwise."""

VARIABLE = "MJPLUG_CONNECT"
"""The environment variable that names another endpoint."""

_HANDSHAKE_MS = 1000
"""How long to wait for an answer to Zenoh's handshake [ms]."""

_RETRY = 0.1
"""Pause between two attempts [s]."""

_SOURCE_PLACE = re.compile(r" at /\S*?\.rs:\d+\.?")


def connect(
    endpoint: str | None = None,
    *,
    server: str = "",
    timeout: float = 5.0,
    config: str | Path | None = None,
) -> Client:
    """Connects to the network of a server, and waits until a server is there.

    Args:
        endpoint: Where a server or a Zenoh router listens; by default what the environment variable MJPLUG_CONNECT
            says, else the first endpoint in `config`, else `tcp/127.0.0.1:7447`.
        server: The full name of the server to talk to, such as `/robot1/mjplug`; needed only where several are, and
            only for names with `~`.
        timeout: How long to wait for a server [s]; 0 is one attempt.
        config: A Zenoh configuration file, for TLS, passwords and so on.

    Returns:
        The client; close it, or use it in a `with` statement.

    Raises:
        NoServerError: Nobody is there, or nobody who lets us in.
        UnknownNameError: There are servers, but none of this name.
    """
    return open_client(endpoint, server, timeout, config)


def open_client(
    endpoint: str | None,
    server: str,
    timeout: float,
    config: str | os.PathLike[str] | None,
    kind: type[Client] = Client,
) -> Client:
    """Connects as `connect` does, with a client of some class."""
    server = f"/{server.removeprefix('/')}" if server else ""
    until = time.monotonic() + bounded(timeout)
    settings = _read(config)
    chosen = _choose(endpoint, settings)
    if config is not None:
        refuse_expired(settings, Path(config))
    _complete(settings, chosen)
    session = _open(settings, chosen, until, None if config is None else Path(config))
    try:
        _wait_for_server(session, chosen, server, until)
        return kind(session, chosen, server)
    except BaseException:
        # An open session would keep the process from ending.
        session.close()  # type: ignore[no-untyped-call]
        raise


def endpoint_for(endpoint: str | None, config: str | Path | None = None) -> str:
    """Returns where `connect` would connect to with these arguments.

    Raises:
        ClientError: The file cannot be used.
    """
    return _choose(endpoint, _read(config))


def _choose(endpoint: str | None, settings: zenoh.Config) -> str:
    return endpoint or os.environ.get(VARIABLE) or _endpoint_in(settings) or DEFAULT_ENDPOINT


def _open(settings: zenoh.Config, endpoint: str, until: float, file: Path | None) -> zenoh.Session:
    while True:
        try:
            return zenoh.open(settings)
        except zenoh.ZError as error:
            if time.monotonic() >= until:
                raise NoServerError(why_refused(settings, file, endpoint) or _way_out(endpoint, error)) from None
        time.sleep(_RETRY)


def _wait_for_server(session: zenoh.Session, endpoint: str, server: str, until: float) -> None:
    while True:
        names = server_names(session)
        if server in names or (names and not server):
            return
        if time.monotonic() >= until:
            break
        time.sleep(_RETRY)
    if names:
        raise UnknownNameError("server", server, names)
    raise NoServerError(
        f"Zenoh answers at {endpoint}, but no mjplug server is on its network; "
        "start one there: mjplug serve bundled:box"
    )


def _read(file: str | os.PathLike[str] | None) -> zenoh.Config:
    try:
        return read_zenoh_file(file)
    except zenoh.ZError as error:
        raise ClientError(f"cannot use the Zenoh configuration file {file}: {_plain(error)}") from None


def _endpoint_in(config: zenoh.Config) -> str | None:
    said = setting(config, "connect/endpoints")
    if isinstance(said, dict):
        # One list for each mode.
        said = said.get("client")
    return str(said[0]) if isinstance(said, list) and said and isinstance(said[0], str) else None


def _complete(config: zenoh.Config, endpoint: str) -> None:
    try:
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    except zenoh.ZError:
        raise NoServerError(
            f"{endpoint!r} is no Zenoh endpoint; write it as protocol/host:port, such as {DEFAULT_ENDPOINT}"
        ) from None
    for key, value in (
        ("mode", "client"),
        ("scouting/multicast/enabled", False),
        ("connect/timeout_ms", _HANDSHAKE_MS),
        ("transport/unicast/open_timeout", _HANDSHAKE_MS),
    ):
        config.insert_json5(key, json.dumps(value))


def _way_out(endpoint: str, error: zenoh.ZError) -> str:
    at_home = "127.0.0.1" in endpoint or "localhost" in endpoint
    port = endpoint.rpartition(":")[2]
    start = "mjplug serve bundled:box" + ("" if endpoint == DEFAULT_ENDPOINT else f" --listen {endpoint}")
    far = f"start one there that lets others in (--listen tcp/0.0.0.0:{port}), or"
    return (
        f"no mjplug server at {endpoint}; {f'start one ({start}), or' if at_home else far} "
        f"give the endpoint that its `ready` line shows (--connect, {VARIABLE}, or connect(endpoint))"
    )


def _plain(error: zenoh.ZError) -> str:
    return _SOURCE_PLACE.sub("", str(error)).strip()
