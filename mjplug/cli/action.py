"""`mjplug action`: lists and shows actions, and sends goals."""

from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mjplug.cli.connected import connected
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_action, complete_action_type
from mjplug.cli.output import complain, say, say_json

if TYPE_CHECKING:
    from mjplug.cli.render import Rendering
    from mjplug.client import Client

app = typer.Typer(name="action", help="Lists and shows actions, and sends goals.", no_args_is_help=True)

ActionName = Annotated[
    str, typer.Argument(metavar="ACTION", help="Name of the action.", autocompletion=complete_action)
]

_CANCEL_TIMEOUT = 10.0
"""How long to wait for the result of a goal that Ctrl-C has cancelled [s]."""


@app.command("list")
@connected
def list_actions(
    client: "Client",
    types: Annotated[bool, typer.Option("--show-types", "-t", help="Show the type of each.")] = False,
    count: Annotated[bool, typer.Option("--count-actions", "-c", help="Show only the number.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Show all properties as JSON.")] = False,
) -> None:
    """Lists the actions of all servers."""
    from dataclasses import asdict

    actions = client.actions()
    if count:
        say(str(len(actions)))
    elif json:
        say_json([asdict(action) for action in actions.values()])
    else:
        for action in actions.values():
            say(f"{action.name} [{action.type}]" if types else action.name)


@app.command("type")
@connected
def type_(client: "Client", action: ActionName) -> None:
    """Shows the type of an action."""
    say(client.action(action).type)


@app.command()
@connected
def find(
    client: "Client",
    type: Annotated[
        str,
        typer.Argument(
            metavar="TYPE",
            help="Such as control_msgs/action/GripperCommand.",
            autocompletion=complete_action_type,
        ),
    ],
) -> None:
    """Lists the actions of a type."""
    from mjplug.cli.values import full_type
    from mjplug.client.types import find as find_type

    wanted = full_type(type, "action")
    names = [action.name for action in client.actions().values() if action.type == wanted]
    if not names:
        # Raises an error if the type does not exist.
        find_type(wanted)
    for name in names:
        say(name)


@app.command()
@connected
def info(
    client: "Client",
    action: ActionName,
    types: Annotated[bool, typer.Option("--show-types", "-t", help="Show the type.")] = False,
    count: Annotated[bool, typer.Option("--count", "-c", help="Show only the numbers of clients and servers.")] = False,
) -> None:
    """Shows the servers of an action."""
    found = client.action(action)
    say(f"Action: {found.name}")
    # A client of the server is no ROS node, so it has no name.
    say("Action clients: 0")
    say("Action servers: 1")
    if not count:
        say(f"    {found.server} [{found.type}]" if types else f"    {found.server}")


@app.command(
    "send_goal",
    epilog=examples(
        "mjplug action send_goal /gripper_controller/gripper_cmd '{command: {position: 0.02}}'",
        "mjplug action send_goal /simulate_steps simulation_interfaces/action/SimulateSteps '{steps: 1000}' --feedback",
    ),
)
@connected
def send_goal(
    client: "Client",
    action: ActionName,
    type: Annotated[
        str | None,
        typer.Argument(
            metavar="TYPE",
            help="Type of the action. Default: as the server reports it.",
            autocompletion=complete_action_type,
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Argument(metavar="GOAL", help="Fields as YAML: '{steps: 100}'. Others have their initial values."),
    ] = None,
    feedback: Annotated[bool, typer.Option("--feedback", "-f", help="Show the feedback.")] = False,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout", min=0.0, metavar="SECONDS", help="How long to wait for the result.  [default: no limit]"
        ),
    ] = None,
    output: Annotated[Literal["yaml", "json"], typer.Option("--output", "-o", help="Output format.")] = ("yaml"),
) -> None:
    """Sends a goal and shows its result. Ctrl-C cancels the goal.

    The exit code is 7 if the goal is rejected, cancelled or aborted.
    """
    from mjplug.cli.render import Rendering
    from mjplug.cli.values import full_type, parse, split_type
    from mjplug.client import WrongTypeError

    type, goal = split_type(type, goal)
    found = client.action(action)
    if type is not None and full_type(type, "action") != found.type:
        raise WrongTypeError(f"action {found.name} is {found.type}, not {full_type(type, 'action')}")
    rendering = Rendering(output)
    fields = parse(goal)
    until = float("inf") if timeout is None else monotonic() + timeout
    sent = client.send_goal(found.name, fields)
    try:
        if output == "yaml":
            _show(rendering, "Sending goal", fields)
            say(f"Goal accepted with ID: {sent.id}\n")
        if feedback:
            while (message := sent.next(max(0.0, until - monotonic()))) is not None:
                _show(rendering, "Feedback", message)
        status = sent.wait(max(0.0, until - monotonic()))
    except KeyboardInterrupt:
        complain("Canceling goal...")
        sent.cancel()
        sent.wait(_CANCEL_TIMEOUT)
        raise
    _show(rendering, "Result", sent.result(check=False))
    if output == "yaml":
        say(f"Goal finished with status: {status}")
    if status != "SUCCEEDED":
        raise typer.Exit(7)


def _show(rendering: "Rendering", heading: str, value: Any) -> None:
    """Shows a message below a heading as ros2 does; in JSON, as an object with one member."""
    if rendering.format == "json":
        say(f'{{"{heading.lower()}": {rendering.text(value)}}}')
    else:
        body = "\n".join(f"    {line}" for line in rendering.text(value).split("\n"))
        say(f"{heading}:\n{body}\n")
