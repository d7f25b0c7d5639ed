"""`mjplug service`: lists, shows and calls services."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mjplug.cli.connected import connected
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_service, complete_service_type
from mjplug.cli.output import complain, say, say_json

if TYPE_CHECKING:
    from mjplug.client import Client

app = typer.Typer(name="service", help="Lists, shows and calls services.", no_args_is_help=True)

ServiceName = Annotated[
    str, typer.Argument(metavar="SERVICE", help="Name of the service.", autocompletion=complete_service)
]


@app.command("list")
@connected
def list_services(
    client: "Client",
    types: Annotated[bool, typer.Option("--show-types", "-t", help="Show the type of each.")] = False,
    count: Annotated[bool, typer.Option("--count-services", "-c", help="Show only the number.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Show all properties as JSON.")] = False,
) -> None:
    """Lists the services of all servers."""
    from dataclasses import asdict

    services = client.services()
    if count:
        say(str(len(services)))
    elif json:
        say_json([asdict(service) for service in services.values()])
    else:
        for service in services.values():
            say(f"{service.name} [{service.type}]" if types else service.name)


@app.command("type")
@connected
def type_(client: "Client", service: ServiceName) -> None:
    """Shows the type of a service."""
    say(client.service(service).type)


@app.command()
@connected
def info(client: "Client", service: ServiceName) -> None:
    """Shows type, server, key and type hash of a service."""
    found = client.service(service)
    say(f"Type: {found.type}")
    say(f"Server: {found.server}")
    say(f"Key: {found.key}")
    say(f"Type hash: {found.hash}")


@app.command()
@connected
def find(
    client: "Client",
    type: Annotated[
        str, typer.Argument(metavar="TYPE", help="Such as std_srvs/srv/Trigger.", autocompletion=complete_service_type)
    ],
) -> None:
    """Lists the services of a type."""
    from mjplug.cli.values import full_type
    from mjplug.client.types import find as find_type

    wanted = full_type(type, "srv")
    names = [service.name for service in client.services().values() if service.type == wanted]
    if not names:
        # Raises an error if the type does not exist.
        find_type(wanted)
    for name in names:
        say(name)


@app.command(
    epilog=examples(
        "mjplug service call '~/set_pause' '{paused: true}'",
        "mjplug service call /mjplug/reset_world mujoco_ros2_control_msgs/srv/ResetWorld '{keyframe: home}'",
    )
)
@connected
def call(
    client: "Client",
    service: ServiceName,
    type: Annotated[
        str | None,
        typer.Argument(
            metavar="TYPE",
            help="Type of the service. Default: as the server reports it.",
            autocompletion=complete_service_type,
        ),
    ] = None,
    values: Annotated[
        str | None,
        typer.Argument(metavar="VALUES", help="Fields as YAML: '{paused: true}'. Others have their initial values."),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            min=0.0,
            metavar="SECONDS",
            help="How long to wait.  [default: the expected duration of the request plus 10 s]",
        ),
    ] = None,
    output: Annotated[Literal["yaml", "json"], typer.Option("--output", "-o", help="Output format.")] = ("yaml"),
) -> None:
    """Calls a service and shows its response.

    The exit code is 7 if the response contains `success: false`.
    """
    from mjplug.cli.exit_codes import exit_code
    from mjplug.cli.render import Rendering
    from mjplug.cli.values import full_type, parse, split_type
    from mjplug.client import RequestRefused, WrongTypeError

    type, values = split_type(type, values)
    found = client.service(service)
    if type is not None and full_type(type, "srv") != found.type:
        raise WrongTypeError(f"service {found.name} is {found.type}, not {full_type(type, 'srv')}")
    rendering = Rendering(output)
    try:
        response = client.call(found.name, parse(values), timeout=timeout)
    except RequestRefused as error:
        if error.response is None:
            raise
        # The response contains the reason.
        say(rendering.text(error.response))
        complain(f"error: {found.name} refused the request")
        raise typer.Exit(exit_code(error)) from None
    say(rendering.text(response))
