"""`mjplug doctor`: looks at everything, says what it finds, and the fix for what is wrong."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.engine import import_mujoco
from mjplug.cli.output import say, say_json

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
            help="Where a server listens, or shall listen.  [default: tcp/127.0.0.1:7447]",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Show what was found as JSON.")] = False,
) -> None:
    """Looks at packages, plugins, graphics, network and scheduling.

    It says how to fix what is wrong, and ends with exit code 1 if something does not work.
    """
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


def _findings(endpoint: str | None) -> "Iterator[Finding]":
    from mjplug.cli.doctor.environment import check_environment
    from mjplug.cli.doctor.graphics import check_graphics
    from mjplug.cli.doctor.network import check_network
    from mjplug.cli.doctor.scheduling import check_scheduling
    from mjplug.client import DEFAULT_ENDPOINT
    from mjplug.core import process

    process.tame_mujoco()
    yield from check_environment()
    yield from check_network(endpoint or DEFAULT_ENDPOINT)
    yield from check_scheduling()
    yield from check_graphics()


def _count(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"
