"""`mjplug topic`: lists, shows, measures and publishes topics."""

from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import connected
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_message_type
from mjplug.cli.output import say, say_json
from mjplug.cli.topic_arguments import TopicName
from mjplug.cli.topic_echo import echo
from mjplug.cli.topic_pub import pub
from mjplug.cli.topic_rates import bw, delay, hz

if TYPE_CHECKING:
    from mjplug.client import Client

app = typer.Typer(name="topic", help="Lists, shows, measures and publishes topics.", no_args_is_help=True)


@app.command("list", epilog=examples("mjplug topic list -t", "mjplug topic list -e tcp/robot.local:7447"))
@connected
def list_topics(
    client: "Client",
    types: Annotated[bool, typer.Option("--show-types", "-t", help="Show the type of each.")] = False,
    count: Annotated[bool, typer.Option("--count-topics", "-c", help="Show only the number.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Show types and the numbers of publishers and subscribers.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Show all properties as JSON.")] = False,
) -> None:
    """Lists the topics of all servers."""
    from dataclasses import asdict

    from mjplug.cli.topic_info import overview

    topics = client.topics()
    if count:
        say(str(len(topics)))
    elif json:
        say_json([asdict(topic) for topic in topics.values()])
    elif verbose:
        for line in overview(topics):
            say(line)
    else:
        for topic in topics.values():
            say(f"{topic.name} [{topic.type}]" if types else topic.name)


@app.command()
@connected
def info(
    client: "Client",
    topic: TopicName,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also show nodes, keys, type hash and quality of service.")
    ] = False,
) -> None:
    """Shows the type of a topic and the numbers of its publishers and subscribers."""
    from mjplug.cli.topic_info import details, summary

    found = client.topic(topic)
    for line in details(found, client.servers()) if verbose else summary(found):
        say(line)


@app.command("type")
@connected
def type_(client: "Client", topic: TopicName) -> None:
    """Shows the type of a topic."""
    say(client.topic(topic).type)


@app.command()
@connected
def find(
    client: "Client",
    type: Annotated[
        str, typer.Argument(metavar="TYPE", help="Such as std_msgs/msg/String.", autocompletion=complete_message_type)
    ],
) -> None:
    """Lists the topics of a type."""
    from mjplug.cli.values import full_type
    from mjplug.client.types import find as find_type

    wanted = full_type(type, "msg")
    names = [topic.name for topic in client.topics().values() if topic.type == wanted]
    if not names:
        # Raises an error if the type does not exist.
        find_type(wanted)
    for name in names:
        say(name)


app.command(
    epilog=examples(
        "mjplug topic echo /clock --once",
        "mjplug topic echo /clock --field clock.sec -o csv",
        "mjplug topic echo /cmd_vel --filter 'm.linear.x > 0.5'",
    )
)(echo)
app.command(
    epilog=examples(
        "mjplug topic pub /cmd_vel '{linear: {x: 0.5}}' -r 10",
        "mjplug topic pub --once /cmd_vel geometry_msgs/msg/Twist '{angular: {z: 1.0}}'",
    )
)(pub)
app.command()(hz)
app.command()(bw)
app.command()(delay)
