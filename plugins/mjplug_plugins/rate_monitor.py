"""Compares the rate a worker process reaches with the requested rate, and reports dropped messages by topic."""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from logging import Logger
from time import monotonic
from typing import Any

from mjplug.plugin import Publisher, Worker

RATE_WINDOW = 5.0
"""Wall time over which rates are averaged [s]."""

WARNING_INTERVAL = 60.0
"""Shortest wall time between two warnings about a slow worker process [s]."""

_MIN_RATIO = 0.5
"""A worker process is too slow if it reaches less than this part of the requested rate."""

_MIN_MISSING = 3
"""A worker process is never too slow while fewer results than this are missing: one may still be in progress."""


@dataclass(slots=True)
class _Source:
    """Counters of one camera or lidar.

    Attributes:
        topics: Its publishers, by the full names of their topics.
        requested: Number of results requested since the start.
        published: Number of results published since the start.
        dropped: Number of requests replaced by a newer one since the start.
        samples: Wall time [s], `requested` and `published` at each check of the last seconds.
    """

    topics: Mapping[str, Publisher[Any]]
    requested: int = 0
    published: int = 0
    dropped: int = 0
    samples: deque[tuple[float, int, int]] = field(default_factory=deque)


class RateMonitor:
    """Counts the requested and published results of each source of a worker process. Physics thread only.

    Args:
        what: What is published, for messages: `images` or `scans`.
        sources: For each camera or lidar, its publishers by the full names of their topics.
        logger: Logger for the warning about a slow worker process.
    """

    def __init__(self, what: str, sources: Mapping[str, Mapping[str, Publisher[Any]]], logger: Logger) -> None:
        now = monotonic()
        self._what = what
        self._sources = {name: _Source(topics, samples=deque([(now, 0, 0)])) for name, topics in sources.items()}
        self._dropped: dict[str, int] = {}
        self._logger = logger
        self._next_warning = 0.0

    def count_requested(self, names: Iterable[str]) -> None:
        """Counts one request for each of these sources."""
        for name in names:
            self._sources[name].requested += 1

    def count_published(self, names: Iterable[str]) -> None:
        """Counts one published result for each of these sources."""
        for name in names:
            self._sources[name].published += 1

    def check(self, worker: Worker, dropped: Mapping[str, int]) -> None:
        """Compares the rates and warns if the worker process is too slow; call it about once per second of wall time.

        Args:
            worker: The worker process that publishes the results.
            dropped: For each source, the number of requests replaced by a newer one since the start.
        """
        now = monotonic()
        for name, source in self._sources.items():
            source.samples.append((now, source.requested, source.published))
            while len(source.samples) > 2 and now - source.samples[1][0] >= RATE_WINDOW:
                source.samples.popleft()
            new, source.dropped = dropped.get(name, 0) - source.dropped, dropped.get(name, 0)
            if new:
                for topic, publisher in source.topics.items():
                    if publisher.matched:
                        self._dropped[topic] = self._dropped.get(topic, 0) + new
        warning = self.warning(worker)
        if warning and now >= self._next_warning:
            self._next_warning = now + WARNING_INTERVAL
            self._logger.warning("%s", warning)

    def warning(self, worker: Worker) -> str:
        """Returns a warning if the worker process reaches less than half of a requested rate, else an empty text."""
        # The log and the status already report a worker process that is not running.
        if worker.status.state not in {"running", "starting"}:
            return ""
        parts = []
        for name, source in self._sources.items():
            (began, requested, published), (ended, requested_now, published_now) = source.samples[0], source.samples[-1]
            requested, published = requested_now - requested, published_now - published
            too_few = published < _MIN_RATIO * requested and requested - published >= _MIN_MISSING
            if ended - began >= RATE_WINDOW and too_few:
                seconds = ended - began
                parts.append(f"{name} reaches {published / seconds:.1f} of {requested / seconds:.1f} {self._what}/s")
        return f"{', '.join(parts)}: {slow_reason(worker)}" if parts else ""

    def values(self) -> dict[str, object]:
        """Returns the rates over the last seconds and the number of drops by topic, for diagnostics."""
        values: dict[str, object] = {}
        for name, source in self._sources.items():
            (began, requested, published), (ended, requested_now, published_now) = source.samples[0], source.samples[-1]
            seconds = max(ended - began, 1e-9)
            values[f"{self._what}/s of {name}"] = round((published_now - published) / seconds, 1)
            values[f"{self._what}/s requested of {name}"] = round((requested_now - requested) / seconds, 1)
        return values | {f"dropped on {topic}": count for topic, count in sorted(self._dropped.items())}


def slow_reason(worker: Worker) -> str:
    """Returns why a worker process is slow, as far as its status shows it."""
    status = worker.status
    if status.state == "starting":
        return "the worker process is still starting"
    if status.state == "restarting":
        return f"the worker process is being restarted: {status.reason}"
    if status.starved > 0.5:
        return (
            f"the worker process waits for a processor {status.starved:.0%} of its time, because other programs keep "
            "the processors busy; see the parameter `priority`"
        )
    return "the worker process is busy; reduce sizes, rates or quality"
