"""`mjplug interface`: the messages and services that mjplug knows."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.examples import examples
from mjplug.cli.names import complete_type
from mjplug.cli.output import say

if TYPE_CHECKING:
    from mjplug_schemas.message import Message, Service

app = typer.Typer(name="interface", help="Shows message and service types.", no_args_is_help=True)

TypeName = Annotated[
    str, typer.Argument(metavar="TYPE", help="Such as std_msgs/msg/String.", autocompletion=complete_type)
]


@app.command("list")
def list_types(
    messages: Annotated[bool, typer.Option("--only-msgs", "-m", help="Only messages.")] = False,
    services: Annotated[bool, typer.Option("--only-srvs", "-s", help="Only services.")] = False,
) -> None:
    """Lists the types."""
    from mjplug_schemas.registry import all_types

    for name in all_types():
        kind = name.split("/")[1]
        if messages == services or kind == ("msg" if messages else "srv"):
            say(name)


@app.command(epilog=examples("mjplug interface show geometry_msgs/msg/Twist"))
def show(type: TypeName) -> None:
    """Shows the definition of a type, as ROS has it in its .msg and .srv files."""
    from mjplug_schemas.definition import definition

    say(definition(_find(type)).rstrip("\n"))


@app.command("hash")
def hash_(type: TypeName) -> None:
    """Shows the type hash (RIHS01) by which ROS 2 nodes know a type."""
    from mjplug_schemas.rihs01 import type_hash

    found: Any = _find(type)
    say(type_hash(found))


def _find(name: str) -> "type[Message] | type[Service]":
    from mjplug.cli.values import full_type
    from mjplug.client.types import find, known

    for kind in ("msg", "srv"):
        if found := known(full_type(name, kind)):
            return found
    return find(name)
