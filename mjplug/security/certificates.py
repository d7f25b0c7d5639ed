"""Creates and reads certificates with the library `cryptography`.

An authority signs server certificates; clients trust the authority's certificate. Each client certificate is signed by
its own issuer, whose key is discarded at once; the server trusts a list of these issuers. To revoke a client, its
issuer is removed from the list. This replaces revocation lists, which Zenoh does not support: Zenoh refuses a client of
an unknown issuer in the handshake.
"""

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

AUTHORITY_DAYS = 3650
"""Validity of an authority and of the issuers of clients [days]. Zenoh does not check it."""

_MAX_CLOCK_SKEW = timedelta(hours=1)
"""A new certificate is valid from this time ago, because the clock of another machine may be slow."""


@dataclass(frozen=True, slots=True)
class Pair:
    """A certificate and its private key, as PEM text.

    Attributes:
        certificate: The certificate.
        key: The key, not encrypted.
    """

    certificate: str
    key: str


def make_authority(name: str) -> Pair:
    """Creates an authority that signs server certificates.

    Args:
        name: Common name of the authority.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    until = datetime.now(UTC) + timedelta(days=AUTHORITY_DAYS)
    return Pair(_pem(_signed(name, key, name, key, until, authority=True)), _pem_of_key(key))


def make_server(name: str, authority: Pair, hosts: Sequence[str], until: datetime) -> Pair:
    """Creates a certificate for a server.

    Args:
        name: Common name of the server.
        authority: The authority that signs the certificate.
        hosts: Names and addresses to which clients connect.
        until: Time of expiry.
    """
    signer = x509.load_pem_x509_certificate(authority.certificate.encode())
    signing_key = serialization.load_pem_private_key(authority.key.encode(), None)
    assert isinstance(signing_key, ec.EllipticCurvePrivateKey)
    key = ec.generate_private_key(ec.SECP256R1())
    return Pair(_pem(_signed(name, key, common_name(signer), signing_key, until, hosts=hosts)), _pem_of_key(key))


def make_client(name: str, until: datetime) -> tuple[Pair, str]:
    """Creates a certificate for a client, and its issuer.

    Args:
        name: Common name of the client, by which the server finds the client's role.
        until: Time of expiry.

    Returns:
        The client's certificate and key, and the certificate of the issuer for the server's list.
    """
    issuer_key = ec.generate_private_key(ec.SECP256R1())
    # The issuer's name is unique, also for a second certificate of one client, because Zenoh finds an issuer by name.
    issuer_name = f"issuer of {name} {x509.random_serial_number():x}"[:64]
    issued_until = max(until, datetime.now(UTC) + timedelta(days=AUTHORITY_DAYS))
    issuer = _signed(issuer_name, issuer_key, issuer_name, issuer_key, issued_until, authority=True)
    key = ec.generate_private_key(ec.SECP256R1())
    return Pair(_pem(_signed(name, key, issuer_name, issuer_key, until)), _pem_of_key(key)), _pem(issuer)


def common_name(certificate: x509.Certificate) -> str:
    """Returns the first common name of a certificate's subject."""
    return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)


def _signed(
    name: str,
    key: ec.EllipticCurvePrivateKey,
    issuer: str,
    issuer_key: ec.EllipticCurvePrivateKey,
    until: datetime,
    *,
    authority: bool = False,
    hosts: Sequence[str] = (),
) -> x509.Certificate:
    builder = (
        x509.CertificateBuilder()
        .subject_name(_name(name))
        .issuer_name(_name(issuer))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(datetime.now(UTC), until) - _MAX_CLOCK_SKEW)
        .not_valid_after(until)
        .add_extension(x509.BasicConstraints(ca=authority, path_length=0 if authority else None), critical=True)
        .add_extension(_usage(authority), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key()), critical=False)
    )
    if not authority:
        # A server needs both, because it may connect to another server.
        purposes = [ExtendedKeyUsageOID.CLIENT_AUTH, *([ExtendedKeyUsageOID.SERVER_AUTH] if hosts else [])]
        builder = builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
    if hosts:
        builder = builder.add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
    return builder.sign(issuer_key, hashes.SHA256())


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _usage(authority: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not authority,
        key_cert_sign=authority,
        crl_sign=authority,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _pem(certificate: x509.Certificate) -> str:
    return certificate.public_bytes(serialization.Encoding.PEM).decode()


def _pem_of_key(key: ec.EllipticCurvePrivateKey) -> str:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    ).decode()
