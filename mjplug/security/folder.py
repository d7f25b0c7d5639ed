"""The folder of `mjplug keys`: an authority, and a certificate for each server and client.

```
keys/
  ca.key  ca.pem  keys.json      the authority; do not copy these files
  server/                        all files that a server needs: copy the folder to the server's machine
    server.json5  server.pem  server.key  trust.pem  roles.json  worker.json5
  operator.json5  viewer.json5   each is the only file that a client needs
```
"""

import ipaddress
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from mjplug.security import zenoh_files
from mjplug.security.certificates import Pair, make_authority, make_client, make_server
from mjplug.security.expiry import day, with_expiry
from mjplug.security.roles import KeysError, Role

FORMAT = 1
DAYS = 365
"""Default validity of a certificate [days]."""

LOCAL = ("localhost", "127.0.0.1", "::1")
"""Names in every server certificate, for worker processes and for clients on the same machine."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,30}")
_INDEX = "keys.json"
_RESERVED = ("trust",)
"""Names that a server cannot have, because the name of its certificate file is already used."""

_HOST = re.compile(
    r"(?=.{1,253}$)[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?(\.[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?)*"
)


@dataclass(frozen=True, slots=True)
class Identity:
    """The owner of a certificate, which may be expired or revoked.

    Attributes:
        name: Common name of the certificate.
        role: Role of the owner.
        expires: Time of expiry, in ISO format.
        revoked: Time of revocation, in ISO format; empty if the certificate is not revoked.
        issuer: Certificate of the issuer, for the list of issuers that servers trust; empty for servers.
        hosts: Names and addresses of a server.
    """

    name: str
    role: Role
    expires: str
    revoked: str = ""
    issuer: str = ""
    hosts: tuple[str, ...] = ()

    @property
    def until(self) -> datetime:
        """When the certificate expires."""
        return datetime.fromisoformat(self.expires)

    @property
    def state(self) -> str:
        """`valid`, or why the certificate is not valid."""
        if self.revoked:
            return f"revoked {day(datetime.fromisoformat(self.revoked))}"
        return "expired" if self.until <= datetime.now(UTC) else "valid"


class KeyFolder:
    """The folder. Each change is written to disk at once.

    Attributes:
        path: The folder's path.
        identities: The owners of all certificates that were ever issued, by name.

    Args:
        path: An existing folder made by `KeyFolder.create`.

    Raises:
        KeysError: The folder has no authority, or its files are damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            index = json.loads((path / _INDEX).read_text(encoding="utf-8"))
            self._authority = Pair((path / "ca.pem").read_text(), (path / "ca.key").read_text())
        except FileNotFoundError as error:
            raise KeysError(
                f"{path} contains no authority ({Path(error.filename).name} is missing); make one with: "
                f"mjplug keys init --out {path}"
            ) from None
        except (OSError, ValueError) as error:
            raise KeysError(f"{path / _INDEX} cannot be read: {error}") from None
        try:
            if index.get("format") != FORMAT:
                raise KeysError(f"{path / _INDEX} has format {index['format']!r}; this version reads format {FORMAT}")
            self._port: int = index["port"]
            entries = (Identity(**{**entry, "hosts": tuple(entry["hosts"])}) for entry in index["identities"])
            self.identities = {identity.name: identity for identity in entries}
        except (AttributeError, KeyError, TypeError) as error:
            raise KeysError(f"{path / _INDEX} is damaged ({error!r}); restore it from a backup") from None

    @classmethod
    def create(cls, path: Path, hosts: Sequence[str], port: int = 7447, days: float = DAYS) -> "KeyFolder":
        """Creates an authority and one certificate for each role.

        Args:
            path: The folder. It may exist, but must not contain an authority.
            hosts: Names and addresses to which clients connect; the files of clients use the first one.
            port: Port that the server listens on.
            days: Validity of the certificates [days].

        Raises:
            KeysError: The folder already contains an authority, or it cannot be written.
        """
        for name in (_INDEX, "ca.key", "ca.pem"):
            if (path / name).exists():
                raise KeysError(
                    f"{path} already contains an authority; add certificates with `mjplug keys add`, or choose "
                    "another folder with --out"
                )
        _check_hosts(hosts)
        authority = make_authority(f"mjplug authority of {hosts[0]}"[:64])
        _make_private(path)
        try:
            _write(path / "ca.key", authority.key)
            _write(path / "ca.pem", authority.certificate)
            _write(path / _INDEX, json.dumps({"format": FORMAT, "port": port, "identities": []}))
            folder = cls(path)
            folder.add("worker", "worker", days=days)
            folder.add("server", "server", hosts=hosts, days=days)
            folder.add("operator", "operator", days=days)
            folder.add("viewer", "viewer", days=days)
        except KeysError:
            # Otherwise a second attempt would be refused.
            for name in (_INDEX, "ca.key", "ca.pem"):
                (path / name).unlink(missing_ok=True)
            raise
        return folder

    def add(self, name: str, role: Role, hosts: Sequence[str] = (), days: float = DAYS) -> Path:
        """Issues a certificate under a new name, or under one whose certificate was revoked.

        Args:
            name: Common name of the certificate.
            role: Role of the owner.
            hosts: Names and addresses of a server.
            days: Validity [days]; a negative number makes an expired certificate, for tests.

        Returns:
            The Zenoh file for the certificate.

        Raises:
            KeysError: The name is in use or not allowed.
        """
        if not _NAME.fullmatch(name):
            raise KeysError(f"the name {name!r} is not allowed; use 1 to 31 letters, digits, `_`, `.` and `-`")
        known = self.identities.get(name)
        if known is not None and not known.revoked:
            raise KeysError(
                f"{name} already has a certificate ({known.role}, {known.state}); replace it with `mjplug keys renew "
                f"{name}`, or choose another name"
            )
        alike = next(
            (other for other in self.identities if other != name and other.casefold() == name.casefold()), None
        )
        if alike is not None:
            raise KeysError(
                f"{name} differs from {alike} only in upper and lower case, which some file systems do not "
                "distinguish; choose another name"
            )
        if role != "server" and hosts:
            raise KeysError(f"--host is for servers only; {name} is a {role}")
        if role == "server" and not hosts:
            raise KeysError("a server needs the names or addresses to which clients connect: --host NAME")
        if role == "server" and (name in _RESERVED or (self.path / name).is_file()):
            raise KeysError(f"{name} is the name of another file; choose another name for the server")
        _check_hosts(hosts)
        if role == "server" and known is not None and known.role != "server":
            raise KeysError(f"{name} had the role {known.role}; choose another name for the server")
        return self._issue(Identity(name, role, "", hosts=tuple(hosts)), days)

    def renew(self, name: str, days: float = DAYS) -> Path:
        """Issues a new certificate that replaces an old one. The old one becomes invalid, except for a server.

        Args:
            name: Common name of the certificate.
            days: Validity [days].

        Returns:
            The Zenoh file for the certificate.

        Raises:
            KeysError: There is no such certificate.
        """
        known = self._known(name)
        if known.revoked:
            raise KeysError(f"{name} was revoked; give it a new certificate with `mjplug keys add {name} --role ROLE`")
        return self._issue(known, days)

    def revoke(self, name: str) -> None:
        """Removes a client's issuer from the list that servers trust, and the client's Zenoh file from the folder.

        Raises:
            KeysError: There is no such certificate, or it belongs to a server.
        """
        known = self._known(name)
        if known.role == "server":
            raise KeysError(
                f"{name} is a server, whose certificate cannot be revoked, because clients trust all certificates of "
                "the authority; make a new authority in another folder instead: mjplug keys init --out DIR"
            )
        if known.revoked:
            raise KeysError(f"{name} was already revoked on {day(datetime.fromisoformat(known.revoked))}")
        self.identities[name] = replace(known, revoked=datetime.now(UTC).isoformat(timespec="seconds"), issuer="")
        self._save()
        self.file(known).unlink(missing_ok=True)

    def file(self, identity: Identity) -> Path:
        """Returns the path of an owner's Zenoh file."""
        if identity.role == "server":
            return self.path / identity.name / f"{identity.name}.json5"
        return self.path / f"{identity.name}.json5"

    @property
    def servers(self) -> Iterator[Identity]:
        """All servers."""
        return (identity for identity in self.identities.values() if identity.role == "server")

    def endpoint(self) -> str:
        """Returns the endpoint to which clients connect: the first host of the first server."""
        host = next(self.servers).hosts[0]
        return f"tls/{f'[{host}]' if ':' in host else host}:{self._port}"

    def _issue(self, identity: Identity, days: float) -> Path:
        until = (datetime.now(UTC) + timedelta(days=days)).replace(microsecond=0)
        if identity.role == "server":
            hosts = tuple(dict.fromkeys((*identity.hosts, *LOCAL)))
            pair, issuer = make_server(identity.name, self._authority, hosts, until), ""
        else:
            pair, issuer = make_client(identity.name, until)
        pair = Pair(with_expiry(pair.certificate, until), pair.key)
        issued = replace(identity, expires=until.isoformat(), issuer=issuer, revoked="")
        self.identities[identity.name] = issued
        file = self.file(issued)
        if issued.role == "server":
            _make_private(file.parent)
            _write(file.with_suffix(".pem"), pair.certificate)
            _write(file.with_suffix(".key"), pair.key)
            if not file.exists():
                _write(file, zenoh_files.server(issued.name, f"tls/0.0.0.0:{self._port}"))
        else:
            # The server passes its endpoint to its worker processes.
            endpoint = "" if issued.role == "worker" else self.endpoint()
            _write(file, zenoh_files.client(issued.name, issued.role, self._authority.certificate, pair, endpoint))
        self._save()
        return file

    def _known(self, name: str) -> Identity:
        if name not in self.identities:
            raise KeysError(f"unknown name {name!r} in {self.path}; known: {', '.join(self.identities)}")
        return self.identities[name]

    def _save(self) -> None:
        """Writes the list of issued certificates, and for each server its roles, trusted issuers and worker file."""
        valid = [identity for identity in self.identities.values() if not identity.revoked]
        roles = json.dumps({identity.name: identity.role for identity in valid}, indent=2)
        trust = self._authority.certificate + "".join(identity.issuer for identity in valid)
        entries = [asdict(identity) for identity in self.identities.values()]
        _write(self.path / _INDEX, json.dumps({"format": FORMAT, "port": self._port, "identities": entries}, indent=2))
        worker = next((self.file(identity) for identity in valid if identity.role == "worker"), None)
        for server in self.servers:
            folder = self.file(server).parent
            _write(folder / "roles.json", roles)
            _write(folder / "trust.pem", trust)
            if worker is not None and worker.exists():
                _write(folder / "worker.json5", worker.read_text())


def _check_hosts(hosts: Sequence[str]) -> None:
    """Checks host names and addresses of a server.

    Raises:
        KeysError: One is neither a host name nor an address of one machine.
    """
    for host in hosts:
        try:
            if ipaddress.ip_address(host).is_unspecified:
                raise KeysError(
                    f"{host} means all addresses of a machine; give a name or address to which clients connect"
                )
        except ValueError:
            if not _HOST.fullmatch(host):
                raise KeysError(
                    f"{host!r} is neither a host name nor an IP address; write it without protocol, port and "
                    "wildcards, such as sim.lab.example or 192.168.1.5"
                ) from None


def _make_private(folder: Path) -> None:
    """Creates a folder that only its owner can open; does not change an existing folder."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        raise KeysError(f"cannot create {folder}: {error.strerror}") from None


def _write(path: Path, text: str) -> None:
    """Writes a file that only its owner can read; if writing fails, the old file remains.

    Raises:
        KeysError: The file cannot be written.
    """
    fresh = path.with_name(f".{path.name}.new")
    try:
        fresh.unlink(missing_ok=True)
        with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
            stream.write(f"{text.rstrip()}\n")
        fresh.replace(path)
    except OSError as error:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise KeysError(f"cannot write {path}: {error.strerror}") from None
