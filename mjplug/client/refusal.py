"""The reasons why a server with certificates refuses a client."""

from datetime import UTC, datetime
from pathlib import Path

import zenoh

from mjplug.client.errors import NoServerError
from mjplug.security.expiry import day, expiry_of
from mjplug.wire.handshake import why_refused
from mjplug.wire.zenoh_file import certificate

__all__ = ["refuse_expired", "why_refused"]


def refuse_expired(config: zenoh.Config, file: Path) -> None:
    """Raises an error if the client's own certificate has expired, because no server would accept it.

    Raises:
        NoServerError: The certificate has expired.
    """
    pem = certificate(config, file, "connect")
    until = expiry_of(pem) if pem is not None else None
    if until is not None and until <= datetime.now(UTC):
        raise NoServerError(
            f"the certificate in {file} expired on {day(until)}; ask for a new one (mjplug keys renew {file.stem})"
        )
