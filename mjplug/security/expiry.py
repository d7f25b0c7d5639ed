"""Expiry dates of certificates."""

import re
from datetime import UTC, datetime

_LINE = re.compile(r"^Expires: (\S+)$", re.MULTILINE)


def with_expiry(pem: str, until: datetime) -> str:
    """Returns a certificate's PEM text with the date in front, for programs that cannot read certificates."""
    return f"Expires: {until.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}\n{pem}"


def expiry_of(pem: str) -> datetime | None:
    """Returns when a certificate in PEM text expires; None if this is unknown.

    It is known if the library `cryptography` is installed or the text has the line that `with_expiry` adds.
    """
    try:
        from cryptography import x509  # noqa: PLC0415 - an extra
    except ImportError:
        found = _LINE.search(pem)
        return None if found is None else datetime.fromisoformat(found[1])
    try:
        return x509.load_pem_x509_certificate(pem.encode()).not_valid_after_utc
    except ValueError:
        # The code that uses the certificate reports what is wrong with it.
        return None


def day(moment: datetime) -> str:
    """Returns a time as text, in minutes and UTC."""
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
