"""Whether a worker process keeps up with what its plugin asks of it: rates, drops by topic, and one line in the log."""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from logging import Logger
from time import monotonic
from typing import Any

from mjplug.plugin import Publisher, Worker

WINDOW = 5.0
"""Wall time over which rates are compared [s]."""

AGAIN = 60.0
"""How long a worker that stays too slow is not reported again [s of wall time]."""

_ENOUGH = 0.5
"""Part of the asked rate below which a worker is too slow."""

_MISSING = 3
"""A worker is not too slow while fewer than this are missing; at low rates, one may just be under way."""


@dataclass(slots=True)
class _Source:
    """One camera or lidar.

    Attributes:
        topics: Its publishers, by the full names of their topics.
        asked: How often it was due since the start.
        made: How often it was made.
        dropped: How often its state was replaced by a newer one.
        marks: Wall time, `asked` and `made` of the last seconds.
    """

    topics: Mapping[str, Publisher[Any]]
    asked: int = 0
    made: int = 0
    dropped: int = 0
    marks: deque[tuple[float, int, int]] = field(default_factory=deque)


class Pace:
    """Counts what was asked and made of each source of a worker. Physics thread only.

    Args:
        what: What is made, for sentences: `images` or `scans`.
        sources: For each camera or lidar, its publishers by the full names of their topics.
        logger: Where a worker that is too slow is reported.
    """

    def __init__(self, what: str, sources: Mapping[str, Mapping[str, Publisher[Any]]], logger: Logger) -> None:
        now = monotonic()
        self._what = what
        self._sources = {name: _Source(topics, marks=deque([(now, 0, 0)])) for name, topics in sources.items()}
        self._dropped: dict[str, int] = {}
        self._logger = logger
        self._silent_until = 0.0

    def ask(self, names: Iterable[str]) -> None:
        """These are due now."""
        for name in names:
            self._sources[name].asked += 1

    def make(self, names: Iterable[str]) -> None:
        """These have been made."""
        for name in names:
            self._sources[name].made += 1

    def look(self, worker: Worker, dropped: Mapping[str, int]) -> None:
        """Compares the rates, and warns if the worker is too slow; to be called about once a second of wall time.

        Args:
            worker: Who makes them.
            dropped: For each source, how often its state was replaced by a newer one since the start.
        """
        now = monotonic()
        for name, source in self._sources.items():
            source.marks.append((now, source.asked, source.made))
            while len(source.marks) > 2 and now - source.marks[1][0] >= WINDOW:
                source.marks.popleft()
            newly, source.dropped = dropped.get(name, 0) - source.dropped, dropped.get(name, 0)
            if newly:
                for topic, publisher in source.topics.items():
                    if publisher.matched:
                        self._dropped[topic] = self._dropped.get(topic, 0) + newly
        slow = self.slow(worker)
        if slow and now >= self._silent_until:
            self._silent_until = now + AGAIN
            self._logger.warning("%s", slow)

    def slow(self, worker: Worker) -> str:
        """Returns a sentence on a worker that makes less than half of what is asked; empty if it keeps up."""
        # Of a process that is not there the log and the status tell already.
        if worker.status.state not in {"running", "starting"}:
            return ""
        parts = []
        for name, source in self._sources.items():
            (began, asked, made), (ended, asked_now, made_now) = source.marks[0], source.marks[-1]
            wanted, reached = asked_now - asked, made_now - made
            if ended - began >= WINDOW and reached < _ENOUGH * wanted and wanted - reached >= _MISSING:
                seconds = ended - began
                parts.append(f"{name} reaches {reached / seconds:.1f} of {wanted / seconds:.1f} {self._what}/s")
        return f"{', '.join(parts)}: {why_slow(worker)}" if parts else ""

    def values(self) -> dict[str, object]:
        """Returns rates over the last seconds and drops by topic, for diagnostics."""
        values: dict[str, object] = {}
        for name, source in self._sources.items():
            (began, asked, made), (ended, asked_now, made_now) = source.marks[0], source.marks[-1]
            seconds = max(ended - began, 1e-9)
            values[f"{self._what}/s of {name}"] = round((made_now - made) / seconds, 1)
            values[f"{self._what}/s asked of {name}"] = round((asked_now - asked) / seconds, 1)
        return values | {f"dropped on {topic}": count for topic, count in sorted(self._dropped.items())}


def why_slow(worker: Worker) -> str:
    """Returns why a worker takes long, as far as that is known."""
    health = worker.status
    if health.state == "starting":
        return "the worker process is still starting"
    if health.state == "restarting":
        return f"the worker process is being started again: {health.reason}"
    if health.starved > 0.5:
        return (
            f"the worker process waits for a processor {health.starved:.0%} of its time, because other programs keep "
            "them busy; see the parameter priority"
        )
    return "the worker process is busy; reduce sizes, rates or quality"
