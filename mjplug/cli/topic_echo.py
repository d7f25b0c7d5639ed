"""`mjplug topic echo`: shows the messages of a topic."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.connected import connected
from mjplug.cli.output import Format, complain, say
from mjplug.cli.qos import QosDepth, QosDurability, QosHistory, QosProfile, QosReliability, qos_of
from mjplug.cli.topic_arguments import MessageType, TopicName

if TYPE_CHECKING:
    from mjplug.cli.field_path import FieldPath
    from mjplug.client import Client, MessageInfo, Subscription

SILENCE = 3.0
"""Time without a first message after which the reason is shown [s]."""

_DEPTH = 1000
"""Maximum number of messages that wait for a slow terminal."""


def kind_of(client: "Client", topic: str, type: str | None) -> Any:
    """Returns the message class of a topic; `dict` if `mjplug_schemas` has no class for its type.

    Raises:
        ClientError: No server has the topic, and no type is given.
        WrongTypeError: The type is unknown, or not that of the topic.
    """
    from mjplug.cli.values import full_type
    from mjplug.client import ClientError, UnknownNameError
    from mjplug.client.graph import GIVE_TYPE
    from mjplug.client.types import known, message_class

    if type is not None:
        return message_class(full_type(type, "msg"))
    try:
        return known(client.topic(topic).type) or dict
    except UnknownNameError as error:
        raise ClientError(f"{error}; {GIVE_TYPE}") from None


@connected
def echo(
    client: "Client",
    topic: TopicName,
    type: MessageType = None,
    once: Annotated[bool, typer.Option("--once", help="Exit after the first message.")] = False,
    count: Annotated[
        int | None, typer.Option("-n", "--count", min=1, metavar="COUNT", help="Exit after this many messages.")
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option("--timeout", min=0.0, metavar="SECONDS", help="Fail if no message arrives for this long."),
    ] = None,
    field: Annotated[
        str | None, typer.Option("--field", metavar="PATH", help="Show only this field: pose.position, ranges[3].")
    ] = None,
    output: Annotated[Format, typer.Option("--output", "-o", help="Output format.")] = "yaml",
    csv: Annotated[bool, typer.Option("--csv", help="The same as -o csv.")] = False,
    full_length: Annotated[bool, typer.Option("--full-length", "-f", help="Show complete lists and strings.")] = False,
    truncate_length: Annotated[
        int,
        typer.Option(
            "--truncate-length",
            "-l",
            min=1,
            metavar="COUNT",
            help="Number of list elements and characters to show, in YAML.",
        ),
    ] = 128,
    no_arr: Annotated[bool, typer.Option("--no-arr", help="Show no lists.")] = False,
    no_str: Annotated[bool, typer.Option("--no-str", help="Show no strings.")] = False,
    flow_style: Annotated[bool, typer.Option("--flow-style", help="Show each message on one line, in YAML.")] = False,
    filter: Annotated[
        str | None,
        typer.Option("--filter", metavar="EXPR", help="Show only messages for which this is true: 'm.linear.x > 0.5'."),
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Show the CDR bytes of each message.")] = False,
    age: Annotated[
        bool, typer.Option("--age", help="Show the age, sequence number and simulated time of each message.")
    ] = False,
    qos_profile: QosProfile = None,
    qos_depth: QosDepth = None,
    qos_history: QosHistory = None,
    qos_reliability: QosReliability = None,
    qos_durability: QosDurability = None,
) -> None:
    """Shows the messages of a topic as they arrive."""
    from mjplug.cli.field_path import FieldPath
    from mjplug.cli.message_filter import MessageFilter
    from mjplug.cli.render import Rendering

    if raw and (field is not None or filter is not None or csv or output != "yaml"):
        raise typer.BadParameter("it cannot be combined with --field, --filter, --csv or --output", param_hint="--raw")
    if age and (csv or output != "yaml"):
        raise typer.BadParameter("it is shown only in YAML; leave out --csv and --output", param_hint="--age")
    chosen = MessageFilter(filter) if filter is not None else None
    qos = qos_of(qos_profile, qos_depth, qos_history, qos_reliability, qos_durability)
    format: Format = "csv" if csv else output
    most = 0 if full_length else truncate_length
    rendering = Rendering(format, most, not no_arr, not no_str, flow_style)
    path = FieldPath(field) if field is not None else None
    kind = kind_of(client, topic, type)
    if path is not None:
        path.check(kind)
    left = 1 if once else count or 0
    with client.subscribe(
        topic, bytes if raw else kind, depth=qos.depth or _DEPTH, history=qos.history(_DEPTH)
    ) as messages:
        value = _part(_first(client, messages, timeout), path)
        headed, warned = format != "csv", False
        while True:
            if chosen is None or chosen(value):
                if not headed:
                    headed = True
                    say(rendering.heading(value, field or ""))
                if age and messages.info is not None:
                    say(_origin_text(messages.info))
                # In Python's notation of bytes, like ros2.
                say(str(value) if raw else rendering.text(value))
                if format == "yaml":
                    say("---")
                left -= 1
                if left == 0:
                    return
            if messages.dropped and not warned:
                warned = True
                complain("warning: messages arrive faster than they can be shown; some are dropped")
            value = _part(messages.next(timeout), path)


def _first(client: "Client", messages: "Subscription[Any]", timeout: float | None) -> Any:
    """Returns the first message; prints the reason if it does not arrive soon."""
    from mjplug.cli.silence import why_silent
    from mjplug.client import TimedOutError

    if timeout is not None and timeout <= SILENCE:
        return messages.next(timeout)
    try:
        return messages.next(SILENCE)
    except TimedOutError:
        complain(f"waiting for {messages.name}: {why_silent(client, messages.name)}")
    try:
        return messages.next(None if timeout is None else timeout - SILENCE)
    except TimedOutError:
        raise TimedOutError(f"no message on {messages.name} within {timeout:g} s") from None


def _origin_text(info: "MessageInfo") -> str:
    """Returns a comment of YAML about when a message was sent, and whether messages before it were lost."""
    origin = info.origin
    if origin is None or info.age is None:
        return "# age unknown: the publisher sends neither times nor sequence numbers"
    parts = [f"age {info.age:.6f} s", f"sequence number {origin.sequence_number}"]
    if origin.time_ns is not None:
        parts += [f"simulated time {origin.time_ns / 1e9:.9f} s", f"epoch {origin.epoch}"]
    parts.append(f"publisher {origin.gid.hex()}")
    if info.lost:
        parts.append(f"lost before it: {info.lost}")
    return f"# {', '.join(parts)}"


def _part(message: Any, path: "FieldPath | None") -> Any:
    return message if path is None else path.get(message)
