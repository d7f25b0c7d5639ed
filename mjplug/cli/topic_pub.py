"""`mjplug topic pub`: publishes messages."""

import time
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import connected
from mjplug.cli.output import say
from mjplug.cli.topic_arguments import MessageType, TopicName
from mjplug.cli.topic_echo import kind_of

if TYPE_CHECKING:
    from mjplug.client import Client


@connected
def pub(
    client: "Client",
    topic: TopicName,
    type: MessageType = None,
    values: Annotated[
        str | None,
        typer.Argument(
            metavar="VALUES", help="Fields as YAML: '{linear: {x: 0.5}}'. Others have their initial values."
        ),
    ] = None,
    rate: Annotated[
        float, typer.Option("--rate", "-r", min=1e-3, metavar="HZ", help="Messages per second of wall time [Hz].")
    ] = 1.0,
    once: Annotated[bool, typer.Option("--once", "-1", help="Send one message.")] = False,
    times: Annotated[
        int | None, typer.Option("--times", "-t", min=1, metavar="COUNT", help="Send this many messages.")
    ] = None,
    wait_matching: Annotated[
        int | None,
        typer.Option(
            "--wait-matching-subscriptions",
            "-w",
            min=0,
            max=1,
            help="1 waits for a subscriber, 0 does not.  [default: 1 with --once and --times]",
        ),
    ] = None,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.0, metavar="SECONDS", help="How long to wait for a subscriber.")
    ] = 5.0,
    print_every: Annotated[
        int, typer.Option("--print", "-p", min=0, metavar="N", help="Print every n-th message; 0 prints none.")
    ] = 1,
) -> None:
    """Publishes a message, once or repeatedly.

    Without --once and --times, it publishes until Ctrl-C.
    """
    from mjplug.cli.render import Rendering
    from mjplug.cli.values import parse, split_type
    from mjplug.client import TimedOutError
    from mjplug.client.types import as_message

    type, values = split_type(type, values)
    kind = kind_of(client, topic, type)
    fields = parse(values)
    message = fields if kind is dict else as_message(fields, kind)
    shown = Rendering(most=16, flow=True).text(message)
    total = 1 if once else times or 0
    publisher = client.publisher(topic, kind)
    waits = total > 0 if wait_matching is None else wait_matching > 0
    if waits and not publisher.wait_for_subscriber(timeout):
        raise TimedOutError(f"no subscriber for {publisher.name} within {timeout:g} s")
    sent, begin = 0, time.monotonic()
    while True:
        publisher.publish(message)
        sent += 1
        if print_every and sent % print_every == 0:
            say(f"publishing #{sent}: {shown}")
        if sent == total:
            return
        # Relative to the first message, so that delays do not add up.
        time.sleep(max(0.0, begin + sent / rate - time.monotonic()))
