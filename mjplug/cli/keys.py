"""`mjplug keys`: certificates and roles for servers and clients."""

import socket
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.examples import examples
from mjplug.cli.output import complain, say, say_json, say_table
from mjplug.errors import MjplugError

if TYPE_CHECKING:
    from mjplug.security.folder import KeyFolder

app = typer.Typer(name="keys", help="Certificates and roles for servers and clients.", no_args_is_help=True)

_Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="The folder of the certificate authority.")]
_Days = Annotated[
    float, typer.Option(min=0.001, max=36500.0, metavar="DAYS", help="How long the certificate is valid.")
]
_Hosts = Annotated[
    list[str] | None,
    typer.Option(
        "--host", metavar="NAME", help="A host name or address of the server, as used by clients. Repeatable."
    ),
]
_Known = Annotated[str, typer.Argument(metavar="NAME", help="The name in the certificate.")]
_KEYS = Path("keys")

RESTART = "Restart the server if it runs: it reads certificates and roles only when it starts."


@app.command(
    epilog=examples("mjplug keys init", "mjplug keys init --host sim.lab.example --host 192.168.1.5 --out lab_keys")
)
def init(
    host: _Hosts = None,
    out: _Out = _KEYS,
    port: Annotated[int, typer.Option(min=1, max=65535, help="The port on which the server listens.")] = 7447,
    days: _Days = 365.0,
) -> None:
    """Creates a certificate authority, and certificates for a server, an operator, a viewer and worker processes.

    Prints the command that starts the server, and one that connects to it.
    """
    folder = _folders().create(out, tuple(host or [socket.gethostname()]), port, days)
    server, operator = (folder.file(folder.identities[name]) for name in ("server", "operator"))
    complain(f"created {out}; clients connect to {folder.endpoint()}. To start a server, and to connect to it:")
    say(f"mjplug serve bundled:box --zenoh-config {server}")
    say(f"mjplug topic list --zenoh-config {operator}")


@app.command(
    epilog=examples("mjplug keys add alice --role viewer", "mjplug keys add sim2 --role server --host sim2.lab.example")
)
def add(
    name: _Known,
    role: Annotated[str, typer.Option(help="operator, viewer, worker or server.")],
    host: _Hosts = None,
    out: _Out = _KEYS,
    days: _Days = 365.0,
) -> None:
    """Issues another certificate."""
    from mjplug.security.roles import ROLES

    wanted = next((known for known in ROLES if known == role), None)
    if wanted is None:
        raise typer.BadParameter(f"{role!r} is unknown; roles are {', '.join(ROLES)}", param_hint="--role")
    say(f"{_folders()(out).add(name, wanted, host or (), days)}")
    complain(RESTART)


@app.command(epilog=examples("mjplug keys renew server", "mjplug keys renew alice --days 30"))
def renew(name: _Known, out: _Out = _KEYS, days: _Days = 365.0) -> None:
    """Issues a new certificate that replaces one that expires or was lost; the role is unchanged."""
    say(f"{_folders()(out).renew(name, days)}")
    complain(RESTART)


@app.command(epilog=examples("mjplug keys revoke alice"))
def revoke(name: _Known, out: _Out = _KEYS) -> None:
    """Revokes the certificate of a client: servers refuse it after their next start."""
    _folders()(out).revoke(name)
    say(f"{name} is revoked")
    complain(f"{RESTART} Until then, {name} is let in. Copy the server's folder again to other machines that have it.")


@app.command(epilog=examples("mjplug keys show", "mjplug keys show --json"))
def show(
    out: _Out = _KEYS, json: Annotated[bool, typer.Option("--json", help="Show the list as JSON.")] = False
) -> None:
    """Lists the certificates: names, roles, expiry dates and whether they are revoked."""
    from mjplug.security.expiry import day

    folder = _folders()(out)
    if json:
        rows = [(one.name, one.role, one.expires, one.state) for one in folder.identities.values()]
        say_json([dict(zip(("name", "role", "expires", "state"), row, strict=True)) for row in rows])
        return
    table = [(one.name, one.role, day(one.until), one.state) for one in folder.identities.values()]
    say_table([("NAME", "ROLE", "EXPIRES", "STATE"), *table])


def _folders() -> "type[KeyFolder]":
    try:
        from mjplug.security.folder import KeyFolder
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "cryptography":
            raise
        raise MjplugError(
            "the library `cryptography`, which creates certificates, is missing: pip install 'mjplug[security]'"
        ) from None
    return KeyFolder
