"""`mjplug topic hz`, `bw` and `delay`: rate, bandwidth and age of messages."""

import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.connected import connected
from mjplug.cli.names import complete_topic
from mjplug.cli.topic_arguments import TopicName

if TYPE_CHECKING:
    import zenoh

    from mjplug.client import Client

TopicNames = Annotated[
    list[str],
    typer.Argument(metavar="TOPIC...", help="The names of one or more topics.", autocompletion=complete_topic),
]
Window = Annotated[
    int, typer.Option("--window", "-w", min=2, metavar="COUNT", help="Number of last messages to average over.")
]
Reports = Annotated[
    int | None, typer.Option("-n", "--count", min=1, metavar="COUNT", help="Exit after this many reports.")
]
Timeout = Annotated[
    float | None,
    typer.Option("--timeout", min=0.0, metavar="SECONDS", help="Fail if no message arrives for this long."),
]
SimTime = Annotated[
    bool, typer.Option("--use-sim-time", "-s", help="Measure simulated time, from the stamps of the messages.")
]


Filter = Annotated[
    str | None,
    typer.Option("--filter", metavar="EXPR", help="Count only messages for which this is true: 'm.linear.x > 0.5'."),
]


@connected
def hz(
    client: "Client",
    topics: TopicNames,
    window: Window = 10_000,
    count: Reports = None,
    timeout: Timeout = None,
    use_sim_time: SimTime = False,
    filter: Filter = None,
) -> None:
    """Measures the rate of messages.

    Prints a report every second until Ctrl-C.
    """
    from mjplug.cli.message_filter import MessageFilter
    from mjplug.cli.rate_meter import Meter, rate, rate_table, report
    from mjplug.client.types import known

    chosen = None if filter is None else MessageFilter(filter)

    def meter(topic: str) -> Meter:
        found = client.topic(topic)
        kind = _stamped(client, topic) if use_sim_time else None
        if chosen is None:
            return Meter(found, window, lambda sample: arrival(sample, kind))
        message_class = known(found.type)
        if message_class is None:
            from mjplug.client import WrongTypeError

            raise WrongTypeError(f"{found.type} is not in mjplug_schemas, so {found.name} cannot be filtered")
        fits = chosen

        def choose(sample: "zenoh.Sample") -> float | None:
            message = message_class.from_cdr(sample.payload.to_bytes())
            return arrival(sample, kind) if fits(message) else None

        return Meter(found, window, choose)

    meters = [meter(topic) for topic in dict.fromkeys(topics)]
    report(client, meters, count, timeout, rate if len(meters) == 1 else rate_table)


@connected
def bw(
    client: "Client", topic: TopicName, window: Window = 100, count: Reports = None, timeout: Timeout = None
) -> None:
    """Measures the bandwidth of a topic.

    Prints a report every second until Ctrl-C.
    """
    from mjplug.cli.rate_meter import Meter, bandwidth, report

    meter = Meter(client.topic(topic), window, lambda sample: (time.monotonic(), len(sample.payload)))
    report(client, [meter], count, timeout, lambda meters: bandwidth(meters[0].values))


@connected
def delay(
    client: "Client", topic: TopicName, window: Window = 10_000, count: Reports = None, timeout: Timeout = None
) -> None:
    """Measures the age of messages when they arrive.

    Prints a report every second until Ctrl-C. Ages are in simulated time, from the stamps of the messages and /clock.
    Between two messages on /clock, simulated time is extrapolated at the rate of the last ones.
    """
    from mjplug.cli.rate_meter import Meter, SimulatedNow, age, report
    from mjplug.cli.silence import why_silent
    from mjplug.client import ClientError, TimedOutError
    from mjplug_schemas.rosgraph_msgs import Clock

    kind = _stamped(client, topic)
    clocks = client.topic("/clock").publishers
    if len(clocks) > 1:
        raise ClientError(
            f"several servers publish /clock: {', '.join(clocks)}; ages are known only with one clock per server, "
            "such as --set 'remap={/clock: /robot2/clock}'"
        )
    now = SimulatedNow()
    client.subscribe("/clock", Clock, now.tick, depth=100)
    if not now.known.wait(timeout if timeout is not None else 5.0):
        raise TimedOutError(
            f"no message on /clock, so the ages of messages are not known: {why_silent(client, '/clock')}"
        )
    meter = Meter(client.topic(topic), window, lambda sample: now() - stamp(kind, sample))
    report(client, [meter], count, timeout, lambda meters: age(meters[0].values))


def arrival(sample: "zenoh.Sample", kind: Any) -> float:
    """Returns the wall time at this moment, or the time by the stamp in a sample of a type [s]."""
    return time.monotonic() if kind is None else stamp(kind, sample)


def _stamped(client: "Client", topic: str) -> Any:
    """Returns the message class of a topic, which must contain a stamp.

    Raises:
        WrongTypeError: It contains none.
    """
    from mjplug.client import WrongTypeError
    from mjplug.client.types import known
    from mjplug_schemas.rosgraph_msgs import Clock

    name = client.topic(topic).type
    kind = known(name)
    if kind is not Clock and "header" not in getattr(kind, "model_fields", {}):
        raise WrongTypeError(f"{name} has no header with a stamp")
    return kind


def stamp(kind: Any, sample: "zenoh.Sample") -> float:
    """Returns the time by the stamp in a sample [s]."""
    message = kind.from_cdr(sample.payload.to_bytes())
    time_ = message.header.stamp if hasattr(message, "header") else message.clock
    return float(time_.sec + time_.nanosec / 1e9)
