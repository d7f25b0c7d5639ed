"""`mjplug interface`: message, service and action types."""

import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.examples import examples
from mjplug.cli.names import complete_type
from mjplug.cli.output import say

if TYPE_CHECKING:
    from mjplug_schemas.registry import Interface

app = typer.Typer(name="interface", help="Shows message, service and action types.", no_args_is_help=True)

TypeName = Annotated[
    str, typer.Argument(metavar="TYPE", help="Such as std_msgs/msg/String.", autocompletion=complete_type)
]


@app.command("list")
def list_types(
    messages: Annotated[bool, typer.Option("--only-msgs", "-m", help="List only messages.")] = False,
    services: Annotated[bool, typer.Option("--only-srvs", "-s", help="List only services.")] = False,
    actions: Annotated[bool, typer.Option("--only-actions", "-a", help="List only actions.")] = False,
) -> None:
    """Lists the types."""
    from mjplug_schemas.registry import all_types

    chosen = [kind for kind, wanted in (("msg", messages), ("srv", services), ("action", actions)) if wanted]
    for name in all_types():
        if not chosen or name.split("/")[1] in chosen:
            say(name)


@app.command(
    epilog=examples(
        "mjplug interface show geometry_msgs/msg/Twist", "mjplug topic type /clock | mjplug interface show -"
    )
)
def show(
    type: Annotated[
        str,
        typer.Argument(
            metavar="TYPE",
            help="Such as std_msgs/msg/String; - reads it from standard input.",
            autocompletion=complete_type,
        ),
    ],
    all_comments: Annotated[
        bool, typer.Option("--all-comments", help="Also show the comments of nested types.")
    ] = False,
    no_comments: Annotated[bool, typer.Option("--no-comments", help="Show no comments and no empty lines.")] = False,
) -> None:
    """Shows the definition of a type in the format of .msg, .srv and .action files, with its nested types."""
    from mjplug.cli.interface_text import definition_lines

    if all_comments and no_comments:
        raise typer.BadParameter("it excludes --no-comments", param_hint="--all-comments")
    name = sys.stdin.readline().strip() if type == "-" else type
    for line in definition_lines(_find(name), comments=not no_comments, inner_comments=all_comments):
        say(line)


@app.command(
    epilog=examples(
        "mjplug interface proto geometry_msgs/msg/Twist",
        'mjplug topic pub --once /cmd_vel "$(mjplug interface proto geometry_msgs/msg/Twist --no-quotes)"',
    )
)
def proto(
    type: TypeName,
    no_quotes: Annotated[bool, typer.Option("--no-quotes", help="Omit the quotes.")] = False,
) -> None:
    """Shows a message, request or goal with its initial values, for `topic pub`, `service call`, `action send_goal`."""
    from mjplug.cli.render import Rendering
    from mjplug_schemas.action import Action
    from mjplug_schemas.message import Service

    found = _find(type)
    shown: Any = found.Goal if issubclass(found, Action) else found
    message = shown.Request() if issubclass(shown, Service) else shown()
    text = Rendering().text(message)
    # Like ros2, with a line break before the closing quote.
    say(text if no_quotes else f'"{text}\n"')


@app.command("hash")
def hash_(type: TypeName) -> None:
    """Shows the type hash (RIHS01) by which ROS 2 nodes identify a type."""
    from mjplug_schemas.rihs01 import type_hash

    found: Any = _find(type)
    say(type_hash(found))


def _find(name: str) -> "Interface":
    from mjplug.cli.values import full_type
    from mjplug.client.types import find, known

    for kind in ("msg", "srv", "action"):
        if found := known(full_type(name, kind)):
            return found
    return find(name)
