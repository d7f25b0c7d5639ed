"""Finds out why a TLS connection was refused. Zenoh says only that it ran into its timeout."""

import re
import socket
import ssl
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import zenoh

from mjplug.security.expiry import day, expiry_of
from mjplug.wire.zenoh_file import certificate, embedded, setting

_ENDPOINT = re.compile(r"tls/(?P<host>\[[^\]]*\]|[^:/?#]+):(?P<port>\d+)")
ENCRYPTED = ("tls/", "quic/")
"""How endpoints begin over which certificates are shown."""

_TLS = "transport/link/tls"
_ANSWER_TIMEOUT = 2.0
"""How long to wait for each answer [s]."""

_EXPIRED, _NOT_YET = 10, 9
_OTHER_NAME = (62, 64)
"""Codes of OpenSSL for what is wrong with a server's certificate."""


def why_refused(config: zenoh.Config, file: Path | None, endpoint: str) -> str | None:
    """Returns the reason in one sentence; None if there is none to be found, or the endpoint is not `tls/…`.

    Args:
        config: The configuration with which Zenoh was refused.
        file: The file it comes from.
        endpoint: Where it was refused.
    """
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return None
    host, port = match["host"].strip("[]"), int(match["port"])
    try:
        with _context(config, file) as context, socket.create_connection((host, port), _ANSWER_TIMEOUT) as plain:
            context.check_hostname = setting(config, f"{_TLS}/verify_name_on_connect") is not False
            with context.wrap_socket(plain, server_hostname=host) as secure:
                # What the server thinks of our certificate comes after the handshake.
                secure.recv(1)
    except ssl.SSLCertVerificationError as error:
        return _wrong_server(error, file, endpoint, host, port)
    except ssl.SSLError as error:
        return _wrong_client(error, config, file, endpoint)
    except (OSError, ValueError):
        # It listens no more, or it takes the certificates and waits for what Zenoh would say.
        return None
    return None


def why_worker_is_refused(config: zenoh.Config, file: Path | None, endpoints: Sequence[str]) -> str:
    """Returns what to add to the error of a worker process that its own server does not let in; may be empty."""
    encrypted = [endpoint for endpoint in endpoints if endpoint.startswith(ENCRYPTED)]
    if not encrypted:
        return ""
    if file is None or (
        setting(config, f"{_TLS}/root_ca_certificate") is None and embedded(file, "root_ca_certificate_base64") is None
    ):
        return (
            f"; worker processes do not trust the server's certificate: add the certificate of its "
            f"authority to {file}, as transport.link.tls.root_ca_certificate"
        )
    reason = why_refused(config, file, encrypted[0])
    return f"; {reason}" if reason is not None else ""


def server_certificate(host: str, port: int) -> str | None:
    """Returns the certificate that a server shows, as PEM text and not verified; None if it shows none."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    try:
        with (
            socket.create_connection((host, port), _ANSWER_TIMEOUT) as plain,
            context.wrap_socket(plain, server_hostname=host) as secure,
        ):
            shown = secure.getpeercert(binary_form=True)
    except OSError:
        return None
    return None if shown is None else ssl.DER_cert_to_PEM_cert(shown)


@contextmanager
def _context(config: zenoh.Config, file: Path | None) -> Iterator[ssl.SSLContext]:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with tempfile.TemporaryDirectory() as folder:
        # Only from files, which nobody else can read here.
        paths: dict[str, str] = {}
        for part in ("root_ca_certificate", "connect_certificate", "connect_private_key"):
            named = setting(config, f"{_TLS}/{part}")
            held = embedded(file, f"{part}_base64") if file is not None else None
            if isinstance(named, str):
                paths[part] = named
            elif held is not None:
                paths[part] = str(Path(folder, part))
                Path(paths[part]).write_text(held)
        if "root_ca_certificate" in paths:
            context.load_verify_locations(cafile=paths["root_ca_certificate"])
        if setting(config, f"{_TLS}/enable_mtls") and "connect_certificate" in paths:
            # Without a password, OpenSSL asks on the terminal for that of an encrypted key. Zenoh takes no such key.
            context.load_cert_chain(paths["connect_certificate"], paths.get("connect_private_key"), password="")
        yield context


def _wrong_server(error: ssl.SSLCertVerificationError, file: Path | None, endpoint: str, host: str, port: int) -> str:
    server = f"the certificate of the server at {endpoint}"
    if error.verify_code in (_EXPIRED, _NOT_YET):
        shown = server_certificate(host, port)
        until = expiry_of(shown) if shown is not None else None
        if error.verify_code == _NOT_YET:
            return f"{server} is not valid yet; compare the clocks of the two machines"
        since = f" on {day(until)}" if until is not None else ""
        return f"{server} expired{since}; its operator makes a new one with: mjplug keys renew server"
    if error.verify_code in _OTHER_NAME:
        return (
            f"{server} is not for {host} ({error.verify_message}); connect by a name or address that it has, or make "
            f"one that has it: mjplug keys init --host {host}"
        )
    if file is None:
        return f"the server at {endpoint} speaks TLS; name the Zenoh file with its authority (--zenoh-config FILE)"
    return f"{server} is not from the authority in {file} (root_ca_certificate): {error.verify_message}"


def _wrong_client(error: ssl.SSLError, config: zenoh.Config, file: Path | None, endpoint: str) -> str | None:
    reason = error.reason or ""
    if "WRONG_VERSION_NUMBER" in reason:
        return f"the program at {endpoint} does not speak TLS"
    if "CERTIFICATE_REQUIRED" in reason:
        return (
            f"the server at {endpoint} lets in only clients with a certificate; name a Zenoh file that has one, as "
            "`mjplug keys` makes them (--zenoh-config FILE)"
        )
    if "ALERT" not in reason:
        return None
    refused = f"the server at {endpoint} refuses the certificate in {file}"
    if "EXPIRED" in reason:
        pem = certificate(config, file, "connect") if file is not None else None
        until = expiry_of(pem) if pem is not None else None
        if until is not None and until > datetime.now(UTC):
            # The same alert says that a certificate is not valid yet.
            return (
                f"{refused} as not valid now, although it is until {day(until)}; compare the clocks of the two machines"
            )
        return f"{refused}: it expired{f' on {day(until)}' if until is not None else ''}"
    if "UNKNOWN_CA" in reason:
        return f"{refused}: it was revoked, or made by another authority, or made after the server was started"
    return f"{refused}: {reason.lower().replace('_', ' ')}"
