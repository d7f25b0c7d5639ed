"""Schedules streaming cameras: each at its rate; cameras due at the same step are submitted together."""

from collections.abc import Callable, Mapping
from typing import Any

from mjplug.plugin import Host, Publisher, Timer

Publishers = list[Publisher[Any]]


class Schedule:
    """Submits the cameras that are due and whose topics have subscribers.

    Args:
        host: Creates the timers.
        submit: Called once per step with the names of all due cameras, so that their images show the same state.
    """

    def __init__(self, host: Host, submit: Callable[[set[str]], None]) -> None:
        self._host = host
        self._submit = submit
        self._rates: list[_Rate] = []
        self._due: set[str] = set()

    def add(self, rate: float, cameras: Mapping[str, Publishers]) -> None:
        """Adds cameras, given with their publishers, at a rate [Hz]."""
        self._rates.append(_Rate(self._host, rate, cameras, self._fire))

    def clear(self) -> None:
        """Discards the cameras that are due."""
        self._due.clear()

    def _fire(self, cameras: set[str]) -> None:
        self._due |= cameras
        if not any(rate.still_due for rate in self._rates):
            due, self._due = self._due, set()
            self._submit(due)


class _Rate:
    """The cameras with the same rate."""

    def __init__(
        self, host: Host, rate: float, cameras: Mapping[str, Publishers], fire: Callable[[set[str]], None]
    ) -> None:
        self._host = host
        self._cameras = cameras
        self._fire = fire
        all_publishers = [publisher for publishers in cameras.values() for publisher in publishers]
        self._timer: Timer = host.create_timer(1.0 / rate, self._call, while_matched=all_publishers)

    @property
    def still_due(self) -> bool:
        """Whether the timer is due at this step but has not been called yet."""
        timer = self._timer
        return timer.due <= self._host.step and not timer.asleep and bool(self._matched_cameras())

    def _call(self) -> None:
        self._fire(self._matched_cameras())

    def _matched_cameras(self) -> set[str]:
        return {name for name, own in self._cameras.items() if any(publisher.matched for publisher in own)}
