"""`mjplug param`: parameters of servers."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.connected import connected
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_node, complete_parameter
from mjplug.cli.node import NodeName
from mjplug.cli.output import complain, say
from mjplug.cli.server_name import server_name

if TYPE_CHECKING:
    from mjplug.client import Client

app = typer.Typer(name="param", help="Lists, shows and sets the parameters of servers.", no_args_is_help=True)

ParameterName = Annotated[
    str, typer.Argument(metavar="NAME", help="The name of the parameter.", autocompletion=complete_parameter)
]


@app.command("list")
@connected
def list_parameters(
    client: "Client",
    node: Annotated[
        str | None,
        typer.Argument(metavar="NODE", help="Name of the server. Default: all servers.", autocompletion=complete_node),
    ] = None,
    prefixes: Annotated[
        list[str] | None,
        typer.Option("--param-prefixes", metavar="PREFIX", help="List only parameters below this prefix. Repeatable."),
    ] = None,
    types: Annotated[bool, typer.Option("--param-type", help="Show the type of each.")] = False,
    filter: Annotated[
        str | None, typer.Option("--filter", metavar="REGEX", help="List only names whose beginning matches this.")
    ] = None,
) -> None:
    """Lists parameters."""
    from mjplug.client.parameters import describe, names_of, type_name

    pattern = _pattern(filter)
    for server in [server_name(client, node)] if node is not None else client.nodes():
        names = [name for name in names_of(client, server, prefixes or ()) if pattern is None or pattern.match(name)]
        if node is None and names:
            say(f"{server}:")
        kinds = {each.name: type_name(each.type) for each in describe(client, server, names)} if types else {}
        for name in names:
            say(f"  {name} (type: {kinds[name]})" if types else f"  {name}")


@app.command()
@connected
def get(
    client: "Client",
    node: NodeName,
    name: ParameterName,
    hide_type: Annotated[bool, typer.Option("--hide-type", help="Show only the value.")] = False,
) -> None:
    """Shows the value of a parameter."""
    from mjplug.client.parameters import label, values_of

    found = values_of(client, server_name(client, node), [name])[0]
    say(_shown(found.value) if hide_type else f"{label(found.type)} {_shown(found.value)}")


# So that -1 is a value and not a flag.
@app.command(
    "set",
    context_settings={"ignore_unknown_options": True},
    epilog=examples("mjplug param set '~' sim.speed 2.0", "mjplug param set /robot1/mjplug sim.speed max"),
)
@connected
def set_(
    client: "Client",
    node: NodeName,
    name: ParameterName,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="The new value, as YAML: 2.0, true, max.")],
) -> None:
    """Sets a parameter."""
    from mjplug.cli.parameter_file import parameter_value
    from mjplug.client import RequestRefused
    from mjplug.client.parameters import set_values

    server = server_name(client, node)
    (result,) = set_values(client, server, {name: parameter_value(value)})
    if not result.successful:
        raise RequestRefused(f"{server}/set_parameters", result.reason)
    say("Set parameter successful" + (f": {result.reason}" if result.reason else ""))


@app.command()
@connected
def describe(
    client: "Client",
    node: NodeName,
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="The names of parameters.", autocompletion=complete_parameter),
    ],
) -> None:
    """Shows the type, description and range of parameters."""
    from mjplug.client.parameters import describe as described
    from mjplug.client.parameters import type_name

    for each in described(client, server_name(client, node), names):
        say(f"Parameter name: {each.name}")
        say(f"  Type: {type_name(each.type)}")
        if each.description:
            say(f"  Description: {each.description}")
        say("  Constraints:")
        if each.read_only:
            say("    Read only: true")
        ranges: tuple[Any, ...] = (*each.floating_point_range, *each.integer_range)
        for limits in ranges:
            say(f"    Min value: {limits.from_value}")
            say(f"    Max value: {limits.to_value}")
            if limits.step:
                say(f"    Step: {limits.step}")
        if each.additional_constraints:
            say(f"    Additional constraints: {each.additional_constraints}")


@app.command(epilog=examples("mjplug param dump /mjplug > mjplug.yaml"))
@connected
def dump(client: "Client", node: NodeName) -> None:
    """Shows all parameters of a server, in the format of ROS parameter files."""
    from mjplug.cli.parameter_file import written
    from mjplug.client.parameters import names_of, values_of

    server = server_name(client, node)
    names = names_of(client, server)
    found = values_of(client, server, names)
    for line in written(server, {name: each.value for name, each in zip(names, found, strict=True)}):
        say(line)


@app.command(epilog=examples("mjplug param load /mjplug mjplug.yaml"))
@connected
def load(
    client: "Client",
    node: NodeName,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A ROS parameter file.")],
    no_wildcard: Annotated[
        bool, typer.Option("--no-use-wildcard", help="Ignore parameters for all nodes (/**).")
    ] = False,
) -> None:
    """Sets the parameters of a server from a ROS parameter file."""
    from mjplug.cli.parameter_file import read
    from mjplug.client.parameters import set_values

    server = server_name(client, node)
    wanted = read(file, server, wildcard=not no_wildcard)
    failed = 0
    for name, result in zip(wanted, set_values(client, server, wanted), strict=True):
        reason = f": {result.reason}" if result.reason else ""
        if result.successful:
            say(f"Set parameter {name} successful{reason}")
        else:
            failed += 1
            complain(f"Set parameter {name} failed{reason}")
    if failed:
        from mjplug.client import RequestRefused

        raise RequestRefused(f"{server}/set_parameters", f"{failed} of {len(wanted)} parameters")


def _pattern(text: str | None) -> re.Pattern[str] | None:
    if text is None:
        return None
    try:
        return re.compile(text)
    except re.error as error:
        raise typer.BadParameter(f"{text!r} is not a regular expression: {error}", param_hint="--filter") from None


def _shown(value: Any) -> str:
    # In Python's notation, like ros2.
    return str(list(value) if isinstance(value, tuple) else value)
