"""`mjplug node`: servers; each is a ROS node."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import connected
from mjplug.cli.names import complete_node
from mjplug.cli.output import say
from mjplug.cli.server_name import server_name

if TYPE_CHECKING:
    from mjplug.client import ActionInfo, Client, ServiceInfo, TopicInfo

app = typer.Typer(name="node", help="Lists and shows servers; each is a ROS node.", no_args_is_help=True)

NodeName = Annotated[
    str,
    typer.Argument(
        metavar="NODE", help="Name of the server: /mjplug, or ~ for the only one.", autocompletion=complete_node
    ),
]


@app.command("list")
@connected
def list_nodes(
    client: "Client",
    count: Annotated[bool, typer.Option("--count-nodes", "-c", help="Show only the number.")] = False,
) -> None:
    """Lists the servers."""
    nodes = client.nodes()
    if count:
        say(str(len(nodes)))
        return
    for node in nodes:
        say(node)


@app.command()
@connected
def info(client: "Client", node: NodeName) -> None:
    """Shows the topics, services and actions of a server."""
    name = server_name(client, node)
    servers = client.servers()
    if name not in servers:
        from mjplug.client import NoServerError

        raise NoServerError(f"server {name} does not answer; it may have stopped")
    server = servers[name]
    topics = server.topics.values()
    say(name)
    _say_names("Subscribers", (topic for topic in topics if topic.subscribers))
    _say_names("Publishers", (topic for topic in topics if topic.publishers))
    _say_names("Service Servers", server.services.values())
    # Servers are no clients.
    _say_names("Service Clients", ())
    _say_names("Action Servers", server.actions.values())
    _say_names("Action Clients", ())


def _say_names(heading: str, entries: "Iterable[TopicInfo | ServiceInfo | ActionInfo]") -> None:
    say(f"  {heading}:")
    for entry in sorted(entries, key=lambda entry: entry.name):
        say(f"    {entry.name}: {entry.type}")
