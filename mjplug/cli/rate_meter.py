"""Measures topics, and reports rate, bandwidth or age once a second."""

import itertools
import statistics
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug.cli.output import say
from mjplug.cli.silence import why_silent
from mjplug.client import Client, TimedOutError, TopicInfo
from mjplug.wakeup import Flag
from mjplug.wire.origin import Gaps, origin_of

REPORT_EVERY = 1.0
"""Period of the reports [s]."""


class Meter:
    """Measures each message of a topic when it arrives, on Zenoh's thread.

    Attributes:
        topic: The topic.
        arrived: Number of messages that have arrived.
        fresh: Whether a message has arrived since the last report.
        failure: The last exception of `measure`.
        gaps: The messages that were sent but did not arrive.

    Args:
        topic: As above.
        window: Maximum number of values to keep; older ones are discarded.
        measure: Returns the value of a sample, or None to ignore the sample.
    """

    def __init__(self, topic: TopicInfo, window: int, measure: Callable[[zenoh.Sample], Any]) -> None:
        self.topic = topic
        self.arrived = 0
        self.fresh = False
        self.failure: Exception | None = None
        self.gaps = Gaps()
        self._measure = measure
        self._values: deque[Any] = deque(maxlen=window)
        self._before = 0

    @property
    def values(self) -> list[Any]:
        """A copy of the values of the last messages; Zenoh's thread continues to add values."""
        return list(self._values.copy())

    def take(self, sample: zenoh.Sample) -> None:
        """Measures a sample."""
        self.arrived += 1
        self.gaps.count(origin_of(sample.attachment))
        if self.arrived == 1:
            # A new subscriber may get a message at once, independent of the rate.
            return
        try:
            value = self._measure(sample)
            if value is not None:
                self._values.append(value)
        except Exception as error:
            self.failure = error

    def look(self) -> None:
        """Updates `fresh`.

        Raises:
            Exception: `measure` has raised it.
        """
        if self.failure is not None:
            raise self.failure
        arrived = self.arrived
        self.fresh, self._before = arrived > self._before, arrived


def report(
    client: Client,
    meters: Sequence[Meter],
    count: int | None,
    timeout: float | None,
    text: Callable[[Sequence[Meter]], str],
) -> None:
    """Prints a report once a second; if there are no messages, prints the reason once.

    Args:
        client: A client on the network.
        meters: The meters of the topics.
        count: Number of reports; None continues without end.
        timeout: Maximum time without a message [s]; None for no limit.
        text: Returns the report on meters with at least two values.

    Raises:
        TimedOutError: No message arrived for this long.
    """
    subscribers = [
        client.session.declare_subscriber(meter.topic.key, Callback(meter.take, indirect=False)) for meter in meters
    ]
    silent_since, printed, reports = time.monotonic(), "", 0
    try:
        while count is None or reports < count:
            time.sleep(REPORT_EVERY)
            for meter in meters:
                meter.look()
            now = time.monotonic()
            if any(meter.fresh for meter in meters):
                silent_since = now
            elif timeout is not None and now - silent_since >= timeout:
                names = ", ".join(meter.topic.name for meter in meters)
                raise TimedOutError(f"no message on {names} within {timeout:g} s")
            ready = [meter for meter in meters if meter.fresh and len(meter.values) > 1]
            line = text(ready) if ready else _silence(client, meters)
            if ready or line != printed:
                say(line)
            printed = line
            reports += 1
    finally:
        for subscriber in subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]


def _silence(client: Client, meters: Sequence[Meter]) -> str:
    if any(meter.fresh for meter in meters):
        return "too few messages yet"
    if any(meter.arrived for meter in meters):
        return f"no new messages: {why_silent(client, meters[0].topic.name, 'nothing is published now')}"
    return f"no messages yet: {why_silent(client, meters[0].topic.name)}"


def rate(meters: Sequence[Meter]) -> str:
    """Returns the report on one topic. Its values are times [s]."""
    found = _rate(meters[0].values)
    if found is None:
        return "average rate: unknown, because all messages have the same time"
    hertz, least, most, spread, number = found
    return (
        f"average rate: {hertz:.3f}\n"
        f"\tmin: {least:.4f}s max: {most:.4f}s std dev: {spread:.5f}s window: {number} lost: {_lost(meters[0])}"
    )


def rate_table(meters: Sequence[Meter]) -> str:
    """Returns the report on several topics. Their values are times [s]."""
    heading = ("topic", "rate", "min_delta", "max_delta", "std_dev", "window", "lost")
    rows = []
    for meter in meters:
        found = _rate(meter.values)
        if found is not None:
            hertz, least, most, spread, number = found
            numbers = (f"{hertz:.3f}", f"{least:.4f}", f"{most:.4f}", f"{spread:.5f}", str(number), _lost(meter))
            rows.append((meter.topic.name, *numbers))
    widths = [max(len(row[i]) for row in (heading, *rows)) for i in range(len(heading))]
    lines = ["   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    title = "   ".join(cell.center(width) for cell, width in zip(heading, widths, strict=True)).rstrip()
    return "\n".join([title, "=" * (sum(widths) + 3 * (len(widths) - 1)), *lines, ""])


def _lost(meter: Meter) -> str:
    return str(meter.gaps.lost) if meter.gaps.known else "unknown"


def _rate(times: list[float]) -> tuple[float, float, float, float, int] | None:
    """Returns the rate [Hz]; minimum, maximum and standard deviation of the intervals [s]; the number of messages."""
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    span = times[-1] - times[0]
    if span <= 0.0:
        return None
    return len(gaps) / span, min(gaps), max(gaps), statistics.pstdev(gaps), len(times)


def bandwidth(samples: list[tuple[float, int]]) -> str:
    """Returns the report on messages, given their times of arrival [s] and sizes [bytes]."""
    sizes = [size for _, size in samples]
    span = samples[-1][0] - samples[0][0]
    # The first message is not part of the interval.
    per_second = _bytes(sum(sizes[1:]) / span) if span > 0.0 else "unknown"
    return (
        f"{per_second}/s from {len(sizes)} messages\n"
        f"\tMessage size mean: {_bytes(statistics.fmean(sizes))} min: {_bytes(min(sizes))} max: {_bytes(max(sizes))}"
    )


def age(ages: list[float]) -> str:
    """Returns the report on messages, given their ages [s]."""
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


class SimulatedNow:
    """The current simulated time, extrapolated from /clock.

    Attributes:
        known: Set when two messages have arrived, which determine time and rate.
    """

    def __init__(self) -> None:
        self.known = Flag()
        # Wall time, simulated time and rate of the last messages, in one tuple, because two threads use it.
        self._last: tuple[float, float, float] | None = None

    def tick(self, message: Any) -> None:
        """Processes a message of /clock."""
        wall, simulated, before = time.monotonic(), message.clock.sec + message.clock.nanosec / 1e9, self._last
        if before is None:
            self._last = (wall, simulated, 0.0)
        elif wall > before[0]:
            self._last = (wall, simulated, (simulated - before[1]) / (wall - before[0]))
            self.known.set()

    def __call__(self) -> float:
        """Returns the current simulated time [s]."""
        assert self._last is not None
        wall, simulated, rate = self._last
        return simulated + rate * (time.monotonic() - wall)
