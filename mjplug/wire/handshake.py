"""Finds out why a TLS connection was refused. Zenoh itself reports only a timeout."""

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
"""Prefixes of the endpoints that use certificates."""

_TLS = "transport/link/tls"
_ANSWER_TIMEOUT = 2.0
"""Timeout of connecting and of each read [s]."""

_EXPIRED, _NOT_YET = 10, 9
_OTHER_NAME = (62, 64)
"""OpenSSL's error codes of an expired certificate, one that is not valid yet, and one for another name or address."""


def why_refused(config: zenoh.Config, file: Path | None, endpoint: str) -> str | None:
    """Returns why a connection was refused; None if no reason was found or the endpoint is not `tls/…`.

    Args:
        config: The configuration of the refused session.
        file: The file of the configuration.
        endpoint: The endpoint that refused the connection.
    """
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return None
    host, port = match["host"].strip("[]"), int(match["port"])
    try:
        with _context(config, file) as context, socket.create_connection((host, port), _ANSWER_TIMEOUT) as plain:
            context.check_hostname = setting(config, f"{_TLS}/verify_name_on_connect") is not False
            with context.wrap_socket(plain, server_hostname=host) as secure:
                # The server reports an invalid client certificate only after the handshake.
                secure.recv(1)
    except ssl.SSLCertVerificationError as error:
        return _wrong_server(error, file, endpoint, host, port)
    except ssl.SSLError as error:
        return _wrong_client(error, config, file, endpoint)
    except (OSError, ValueError):
        # The server no longer listens, or it accepts the certificates and waits for Zenoh's first message.
        return None
    return None


def why_worker_is_refused(config: zenoh.Config, file: Path | None, endpoints: Sequence[str]) -> str:
    """Returns the text to append to the error of a worker process whose server refuses its connection; may be empty."""
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
    """Returns the certificate of a server as PEM text, without verifying it; None if the server sends none."""
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
        # ssl loads keys and certificates from files only; no other user can read this folder.
        paths: dict[str, str] = {}
        for part in ("root_ca_certificate", "connect_certificate", "connect_private_key"):
            named = setting(config, f"{_TLS}/{part}")
            content = embedded(file, f"{part}_base64") if file is not None else None
            if isinstance(named, str):
                paths[part] = named
            elif content is not None:
                paths[part] = str(Path(folder, part))
                Path(paths[part]).write_text(content)
        if "root_ca_certificate" in paths:
            context.load_verify_locations(cafile=paths["root_ca_certificate"])
        if setting(config, f"{_TLS}/enable_mtls") and "connect_certificate" in paths:
            # Without a password argument, OpenSSL would ask for one on the terminal. Zenoh supports no encrypted keys.
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
            f"{server} is not valid for {host} ({error.verify_message}); connect to a name or address that is in the "
            f"certificate, or make a new certificate: mjplug keys init --host {host}"
        )
    if file is None:
        return (
            f"the server at {endpoint} uses TLS; give a Zenoh file with the certificate of its authority "
            "(--zenoh-config FILE)"
        )
    return f"{server} was not issued by the authority in {file} (root_ca_certificate): {error.verify_message}"


def _wrong_client(error: ssl.SSLError, config: zenoh.Config, file: Path | None, endpoint: str) -> str | None:
    reason = error.reason or ""
    if "WRONG_VERSION_NUMBER" in reason:
        return f"the program at {endpoint} does not use TLS"
    if "CERTIFICATE_REQUIRED" in reason:
        return (
            f"the server at {endpoint} requires a client certificate; give a Zenoh file that contains one, such as a "
            "file made by `mjplug keys` (--zenoh-config FILE)"
        )
    if "ALERT" not in reason:
        return None
    refused = f"the server at {endpoint} refuses the certificate in {file}"
    if "EXPIRED" in reason:
        pem = certificate(config, file, "connect") if file is not None else None
        until = expiry_of(pem) if pem is not None else None
        if until is not None and until > datetime.now(UTC):
            # The same alert also means that a certificate is not valid yet.
            return (
                f"{refused} as not valid now, but it is valid until {day(until)}; compare the clocks of the two "
                "machines"
            )
        return f"{refused}: it expired{f' on {day(until)}' if until is not None else ''}"
    if "UNKNOWN_CA" in reason:
        return f"{refused}: it was revoked, issued by another authority, or made after the server was started"
    return f"{refused}: {reason.lower().replace('_', ' ')}"
