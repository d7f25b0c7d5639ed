"""The folder that `mjplug keys` keeps: an authority, and a certificate for each server and client.

```
keys/
  ca.key  ca.pem  keys.json      the authority; stays here
  server/                        all that a server needs: copy it to the machine that serves
    server.json5  server.pem  server.key  trust.pem  roles.json  worker.json5
  operator.json5  viewer.json5   each is all that one client needs
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
"""How long a certificate is valid unless it is said [days]."""

LOCAL = ("localhost", "127.0.0.1", "::1")
"""Names in every server certificate, for worker processes and for clients on the same machine."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,30}")
_INDEX = "keys.json"
_RESERVED = ("trust",)
"""Names that a server cannot have: its certificate would be in the file of those it trusts."""

_HOST = re.compile(
    r"(?=.{1,253}$)[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?(\.[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?)*"
)


@dataclass(frozen=True, slots=True)
class Identity:
    """Somebody who has, or had, a certificate.

    Attributes:
        name: The common name of the certificate.
        role: What the owner may do.
        expires: When the certificate expires, in ISO format.
        revoked: When it was revoked, in ISO format; empty if it was not.
        issuer: The certificate of its issuer, for the list of those that servers trust; empty for servers.
        hosts: The names and addresses of a server.
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
        """Returns `valid`, or why the certificate is not."""
        if self.revoked:
            return f"revoked {day(datetime.fromisoformat(self.revoked))}"
        return "expired" if self.until <= datetime.now(UTC) else "valid"


class KeyFolder:
    """The folder; each change is written at once.

    Attributes:
        path: Where it is.
        identities: All that were ever issued, by name.

    Args:
        path: An existing folder of `KeyFolder.create`.

    Raises:
        KeysError: There is no authority in it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            told = json.loads((path / _INDEX).read_text(encoding="utf-8"))
            self._authority = Pair((path / "ca.pem").read_text(), (path / "ca.key").read_text())
        except FileNotFoundError as error:
            raise KeysError(
                f"{path} has no authority ({Path(error.filename).name} is missing); make one with: "
                f"mjplug keys init --out {path}"
            ) from None
        except (OSError, ValueError) as error:
            raise KeysError(f"{path / _INDEX} cannot be read: {error}") from None
        try:
            if told.get("format") != FORMAT:
                raise KeysError(f"{path / _INDEX} has format {told['format']!r}; this version reads format {FORMAT}")
            self._port: int = told["port"]
            entries = (Identity(**{**entry, "hosts": tuple(entry["hosts"])}) for entry in told["identities"])
            self.identities = {identity.name: identity for identity in entries}
        except (AttributeError, KeyError, TypeError) as error:
            raise KeysError(f"{path / _INDEX} is damaged ({error!r}); take it from a backup") from None

    @classmethod
    def create(cls, path: Path, hosts: Sequence[str], port: int = 7447, days: float = DAYS) -> "KeyFolder":
        """Makes an authority and one certificate for each role.

        Args:
            path: The folder, which may exist, but without an authority.
            hosts: The names and addresses by which clients call the server; the first is the one they use.
            port: Where it listens.
            days: How long the certificates are valid.

        Raises:
            KeysError: There is an authority already, or the folder cannot be written.
        """
        for name in (_INDEX, "ca.key", "ca.pem"):
            if (path / name).exists():
                raise KeysError(
                    f"{path} has an authority already, which is left as it is; add certificates with `mjplug keys "
                    "add`, or choose another folder with --out"
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
            # Otherwise a second attempt would find an authority.
            for name in (_INDEX, "ca.key", "ca.pem"):
                (path / name).unlink(missing_ok=True)
            raise
        return folder

    def add(self, name: str, role: Role, hosts: Sequence[str] = (), days: float = DAYS) -> Path:
        """Issues a certificate under a new name, or under one whose certificate was revoked.

        Args:
            name: The name.
            role: What its owner may do.
            hosts: The names and addresses of a server.
            days: How long it is valid; a test may give a negative number.

        Returns:
            The Zenoh file to use it.

        Raises:
            KeysError: The name is taken or not allowed.
        """
        if not _NAME.fullmatch(name):
            raise KeysError(f"the name {name!r} is not allowed; use 1 to 31 letters, digits, `_`, `.` and `-`")
        known = self.identities.get(name)
        if known is not None and not known.revoked:
            raise KeysError(
                f"{name} has a certificate already ({known.role}, {known.state}); replace it with `mjplug keys renew "
                f"{name}`, or choose another name"
            )
        alike = next(
            (other for other in self.identities if other != name and other.casefold() == name.casefold()), None
        )
        if alike is not None:
            raise KeysError(f"{name} and {alike} would be one file where upper and lower case are the same")
        if role != "server" and hosts:
            raise KeysError(f"only a server has names and addresses by which clients call it; {name} is a {role}")
        if role == "server" and not hosts:
            raise KeysError("a server needs the names or addresses by which clients call it: --host NAME")
        if role == "server" and (name in _RESERVED or (self.path / name).is_file()):
            raise KeysError(f"{name} is the name of another file; choose another name for the server")
        _check_hosts(hosts)
        if role == "server" and known is not None and known.role != "server":
            raise KeysError(f"{name} was a {known.role}; choose another name for a server")
        return self._issue(Identity(name, role, "", hosts=tuple(hosts)), days)

    def renew(self, name: str, days: float = DAYS) -> Path:
        """Issues a new certificate in place of an old one, which is valid no more except for a server.

        Returns:
            The Zenoh file to use it.

        Raises:
            KeysError: There is no such certificate.
        """
        known = self._known(name)
        if known.revoked:
            raise KeysError(f"{name} was revoked; give it a new certificate with `mjplug keys add {name} --role ROLE`")
        return self._issue(known, days)

    def revoke(self, name: str) -> None:
        """Takes a client's certificate out of what servers trust, and its Zenoh file out of the folder.

        Raises:
            KeysError: There is no such certificate, or it is a server's.
        """
        known = self._known(name)
        if known.role == "server":
            raise KeysError(
                f"{name} is a server, and clients trust every certificate of the authority; to get rid of a server, "
                "make a new authority in another folder: mjplug keys init --out DIR"
            )
        if known.revoked:
            raise KeysError(f"{name} was revoked already, on {day(datetime.fromisoformat(known.revoked))}")
        self.identities[name] = replace(known, revoked=datetime.now(UTC).isoformat(timespec="seconds"), issuer="")
        self._save()
        self.file(known).unlink(missing_ok=True)

    def file(self, identity: Identity) -> Path:
        """Returns the Zenoh file of somebody."""
        if identity.role == "server":
            return self.path / identity.name / f"{identity.name}.json5"
        return self.path / f"{identity.name}.json5"

    @property
    def servers(self) -> Iterator[Identity]:
        """All servers."""
        return (identity for identity in self.identities.values() if identity.role == "server")

    def endpoint(self) -> str:
        """Returns where clients connect: the first server's first name."""
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
            # A worker process is told where its server is.
            endpoint = "" if issued.role == "worker" else self.endpoint()
            _write(file, zenoh_files.client(issued.name, issued.role, self._authority.certificate, pair, endpoint))
        self._save()
        return file

    def _known(self, name: str) -> Identity:
        if name not in self.identities:
            raise KeysError(f"there is no {name!r} in {self.path}; there are: {', '.join(self.identities)}")
        return self.identities[name]

    def _save(self) -> None:
        """Writes the list of what was issued, and for each server whom it trusts with what."""
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
    """Raises if something is neither a host name nor an address of one machine.

    Raises:
        KeysError: It is not.
    """
    for host in hosts:
        try:
            if ipaddress.ip_address(host).is_unspecified:
                raise KeysError(
                    f"{host} stands for every address of a machine; name one by which clients call the server"
                )
        except ValueError:
            if not _HOST.fullmatch(host):
                raise KeysError(
                    f"{host!r} is no host name and no IP address; write it without protocol, port and wildcards, such "
                    "as sim.lab.example or 192.168.1.5"
                ) from None


def _make_private(folder: Path) -> None:
    """Makes a folder that only its owner can open; one that is there stays as it is."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        raise KeysError(f"cannot make {folder}: {error.strerror}") from None


def _write(path: Path, text: str) -> None:
    """Writes a file that only its owner can read, as a whole or not at all.

    Raises:
        KeysError: It cannot be written.
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
