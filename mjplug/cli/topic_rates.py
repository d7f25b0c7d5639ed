"""`mjplug topic hz`, `bw` and `delay`: how often messages come, how large they are and how old."""

import itertools
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.connected import connected
from mjplug.cli.names import complete_topic
from mjplug.cli.output import say
from mjplug.cli.topic_echo import kind_of

if TYPE_CHECKING:
    import zenoh

    from mjplug.client import Client

REPORT_EVERY = 1.0
"""How often a line is printed [s]."""

TopicName = Annotated[str, typer.Argument(metavar="TOPIC", help="Its name.", autocompletion=complete_topic)]
Window = Annotated[
    int, typer.Option("--window", "-w", min=2, metavar="COUNT", help="How many of the last messages count.")
]
Reports = Annotated[
    int | None, typer.Option("-n", "--count", min=1, metavar="COUNT", help="End after so many reports.")
]
Timeout = Annotated[
    float | None, typer.Option("--timeout", min=0.0, metavar="SECONDS", help="Fail if no message comes for so long.")
]
SimTime = Annotated[
    bool, typer.Option("--use-sim-time", "-s", help="Count simulated seconds, by the stamps of the messages.")
]


@connected
def hz(
    client: "Client",
    topic: TopicName,
    window: Window = 10_000,
    count: Reports = None,
    timeout: Timeout = None,
    use_sim_time: SimTime = False,
) -> None:
    """Measures how often messages come.

    Prints a report every second until Ctrl-C.
    """
    kind = _stamped(client, topic) if use_sim_time else None
    _report(client, topic, window, count, timeout, lambda sample: arrival(sample, kind), _rate)


@connected
def bw(
    client: "Client", topic: TopicName, window: Window = 100, count: Reports = None, timeout: Timeout = None
) -> None:
    """Measures how many bytes come.

    Prints a report every second until Ctrl-C.
    """
    _report(client, topic, window, count, timeout, lambda sample: (time.monotonic(), len(sample.payload)), bandwidth)


@connected
def delay(
    client: "Client", topic: TopicName, window: Window = 10_000, count: Reports = None, timeout: Timeout = None
) -> None:
    """Measures how old messages are when they come.

    Prints a report every second until Ctrl-C. Ages are in simulated time, by the stamps of the messages and /clock.
    Between two messages on /clock, simulated time is taken to go on at the rate of the last ones.
    """
    from mjplug.client import ClientError, TimedOutError
    from mjplug_schemas.rosgraph_msgs import Clock

    kind = _stamped(client, topic)
    clocks = client.topic("/clock").publishers
    if len(clocks) > 1:
        raise ClientError(
            f"several servers publish /clock: {', '.join(clocks)}; no age is known unless each has one of its own, "
            "such as --set 'remap={/clock: /robot2/clock}'"
        )
    now = _SimulatedNow()
    client.subscribe("/clock", Clock, now.tick, depth=100)
    if not now.known.wait(timeout if timeout is not None else 5.0):
        raise TimedOutError("nothing comes on /clock, so nobody knows how old a message is")
    _report(client, topic, window, count, timeout, lambda sample: now() - _stamp(kind, sample), _age)


def _report(
    client: "Client",
    topic: str,
    window: int,
    count: int | None,
    timeout: float | None,
    measure: "Callable[[zenoh.Sample], Any]",
    line: Callable[[list[Any]], str],
) -> None:
    """Measures each sample when it comes, on Zenoh's thread, and prints what follows once a second."""
    import zenoh
    from zenoh.handlers import Callback

    from mjplug.client import TimedOutError

    found = client.topic(topic)
    values: deque[Any] = deque(maxlen=window)
    arrivals, failure, wake = [0], [], threading.Event()

    def take(sample: zenoh.Sample) -> None:
        arrivals[0] += 1
        if arrivals[0] == 1:
            # A first listener may be given a message at once, whatever the rate.
            return
        try:
            values.append(measure(sample))
        except Exception as error:
            failure.append(error)
            wake.set()

    subscriber = client.session.declare_subscriber(found.key, Callback(take, indirect=False))
    before, silent_since, reports = 0, time.monotonic(), 0
    try:
        while count is None or reports < count:
            wake.wait(REPORT_EVERY)
            if failure:
                raise failure[0]
            now = time.monotonic()
            if arrivals[0] > before:
                silent_since = now
            elif timeout is not None and now - silent_since >= timeout:
                raise TimedOutError(f"no message on {found.name} within {timeout:g} s")
            fresh, before = arrivals[0] > before, arrivals[0]
            # A copy: Zenoh's thread goes on writing.
            taken = list(values.copy())
            say(line(taken) if fresh and len(taken) > 1 else _too_few(before, fresh))
            reports += 1
    finally:
        subscriber.undeclare()  # type: ignore[no-untyped-call]


def _too_few(arrived: int, fresh: bool) -> str:
    if not arrived:
        return "no messages yet"
    return "too few messages yet" if fresh else "no new messages"


def arrival(sample: "zenoh.Sample", kind: Any) -> float:
    """Returns the wall time at this moment, or the time by the stamp in a sample of a type [s]."""
    return time.monotonic() if kind is None else _stamp(kind, sample)


def _rate(times: list[float]) -> str:
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    span = times[-1] - times[0]
    if span <= 0.0:
        return "average rate: unknown, since time stands still"
    return (
        f"average rate: {len(gaps) / span:.3f}\n"
        f"\tmin: {min(gaps):.4f}s max: {max(gaps):.4f}s std dev: {statistics.pstdev(gaps):.5f}s window: {len(times)}"
    )


def bandwidth(samples: list[tuple[float, int]]) -> str:
    """Returns the report on messages of which the time of arrival [s] and the size [bytes] are known."""
    sizes = [size for _, size in samples]
    span = samples[-1][0] - samples[0][0]
    # The first one came before the span.
    per_second = _bytes(sum(sizes[1:]) / span) if span > 0.0 else "unknown"
    return (
        f"{per_second}/s from {len(sizes)} messages\n"
        f"\tMessage size mean: {_bytes(statistics.fmean(sizes))} min: {_bytes(min(sizes))} max: {_bytes(max(sizes))}"
    )


def _age(ages: list[float]) -> str:
    return (
        f"average delay: {statistics.fmean(ages):.4f}\n"
        f"\tmin: {min(ages):.4f}s max: {max(ages):.4f}s std dev: {statistics.pstdev(ages):.5f}s window: {len(ages)}"
    )


def _bytes(count: float) -> str:
    for unit in ("B", "KB", "MB"):
        if count < 1000.0:
            return f"{count:.0f} B" if unit == "B" else f"{count:.2f} {unit}"
        count /= 1000.0
    return f"{count:.2f} GB"


def _stamped(client: "Client", topic: str) -> Any:
    """Returns the class of a topic's messages, which must have a time in them.

    Raises:
        WrongTypeError: They have none.
    """
    from mjplug.client import WrongTypeError
    from mjplug_schemas.rosgraph_msgs import Clock

    kind = kind_of(client, topic, None)
    if kind is not Clock and "header" not in getattr(kind, "model_fields", {}):
        raise WrongTypeError(f"{client.topic(topic).type} has no header with a stamp, so its times are not known")
    return kind


def _stamp(kind: Any, sample: "zenoh.Sample") -> float:
    message = kind.from_cdr(sample.payload.to_bytes())
    time_ = message.header.stamp if hasattr(message, "header") else message.clock
    return float(time_.sec + time_.nanosec / 1e9)


class _SimulatedNow:
    """Simulated time at any moment, from the messages on /clock.

    Attributes:
        known: Set once two messages have told time and rate.
    """

    def __init__(self) -> None:
        self.known = threading.Event()
        # Wall time, simulated time and the rate between the last two messages, replaced as one: two threads use it.
        self._last: tuple[float, float, float] | None = None

    def tick(self, message: Any) -> None:
        """Takes a message."""
        wall, simulated, before = time.monotonic(), message.clock.sec + message.clock.nanosec / 1e9, self._last
        if before is None:
            self._last = (wall, simulated, 0.0)
        elif wall > before[0]:
            self._last = (wall, simulated, (simulated - before[1]) / (wall - before[0]))
            self.known.set()

    def __call__(self) -> float:
        assert self._last is not None
        wall, simulated, rate = self._last
        return simulated + rate * (time.monotonic() - wall)
