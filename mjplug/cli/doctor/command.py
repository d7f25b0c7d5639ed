"""`mjplug doctor`: checks the installation and the machine, and prints how to fix each problem."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.doctor.quick import TIMEOUT, check_quickly
from mjplug.cli.engine import import_mujoco
from mjplug.cli.output import say, say_json, say_table

if TYPE_CHECKING:
    from mjplug.cli.doctor.finding import Finding


def doctor(
    connect: Annotated[
        str | None,
        typer.Option(
            "--connect",
            "-e",
            metavar="ENDPOINT",
            envvar="MJPLUG_CONNECT",
            help="Endpoint where a server listens or will listen.  [default: tcp/127.0.0.1:7447]",
        ),
    ] = None,
    security: Annotated[
        bool, typer.Option("--security", help="Only test what clients are allowed to do with a running server.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="Only ask a running server whether it is healthy; exit code 0 if so.")
    ] = False,
    server: Annotated[
        str,
        typer.Option(
            "--server", metavar="NAME", help="With --quick: server to ask when several are running: /robot1/mjplug."
        ),
    ] = "",
    zenoh_config: Annotated[
        str | None,
        typer.Option(
            "--zenoh-config",
            metavar="FILE",
            help="Zenoh configuration file of the client that --quick or --security connects as.",
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option("--timeout", min=0.0, metavar="SECONDS", help="With --quick: how long to wait for the answer."),
    ] = TIMEOUT,
) -> None:
    """Checks packages, plugins, network, scheduling and graphics, and opens a server for a moment.

    It prints how to fix each problem. The exit code is 1 if something does not work. With --security, the exit code is
    1 if a client can do something that should be denied.
    """
    if quick:
        check_quickly(connect, server, zenoh_config, timeout)
        return
    if security:
        _security(connect, zenoh_config, json)
        return
    import_mujoco()
    from dataclasses import asdict

    found = []
    topic = ""
    for finding in _findings(connect):
        found.append(finding)
        if json:
            continue
        if finding.topic != topic:
            topic = finding.topic
            say(topic)
        say(f"  {finding.level:<8} {finding.message}")
        if finding.fix:
            say(f"  {'':<8} -> {finding.fix}")
    errors, warnings = (sum(finding.level == level for finding in found) for level in ("error", "warning"))
    if json:
        say_json({"errors": errors, "warnings": warnings, "findings": [asdict(finding) for finding in found]})
    else:
        say(f"{_count(errors, 'error')}, {_count(warnings, 'warning')}")
    if errors:
        raise typer.Exit(1)


def _security(endpoint: str | None, file: str | None, json: bool) -> None:
    from dataclasses import asdict
    from pathlib import Path

    from mjplug.cli.doctor.security import ANONYMOUS, check_security
    from mjplug.client.connection import endpoint_for

    path = None if file is None else Path(file)
    attempts = list(check_security(endpoint_for(endpoint, path), path))
    faults = sum(attempt.fault for attempt in attempts)
    if json:
        say_json({"faults": faults, "attempts": [asdict(attempt) for attempt in attempts]})
    else:
        rows = [(a.client, a.action, a.result, "SHOULD BE DENIED" if a.fault else a.note) for a in attempts]
        say_table([("CLIENT", "ACTION", "RESULT", "NOTE"), *rows])
        verb = "is" if faults == 1 else "are"
        say(f"{_count(faults, 'action')} {verb} allowed that should be denied")
        if any(attempt.fault and attempt.client == ANONYMOUS for attempt in attempts):
            say("to create certificates and roles: mjplug keys init; see Security in the documentation")
    if faults:
        raise typer.Exit(1)


def _findings(endpoint: str | None) -> "Iterator[Finding]":
    from mjplug.cli.doctor.environment import check_environment
    from mjplug.cli.doctor.graphics import check_graphics
    from mjplug.cli.doctor.network import check_network
    from mjplug.cli.doctor.scheduling import check_scheduling
    from mjplug.cli.doctor.self_test import check_server
    from mjplug.client import DEFAULT_ENDPOINT
    from mjplug.physics import process

    process.configure_mujoco()
    yield from check_environment()
    yield from check_network(endpoint or DEFAULT_ENDPOINT)
    yield from check_server()
    yield from check_scheduling()
    yield from check_graphics()


def _count(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"
