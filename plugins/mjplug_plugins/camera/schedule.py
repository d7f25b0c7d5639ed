"""When cameras stream: each at its rate, those of one instant together."""

from collections.abc import Callable, Mapping
from typing import Any

from mjplug.plugin import Host, Publisher, Timer

Publishers = list[Publisher[Any]]


class Schedule:
    """Calls for the cameras that are due and listened to.

    Args:
        host: Where timers are started.
        submit: Gets the names of all cameras of one instant at once, so that they can share one state.
    """

    def __init__(self, host: Host, submit: Callable[[set[str]], None]) -> None:
        self._host = host
        self._submit = submit
        self._rates: list[_Rate] = []
        self._due: set[str] = set()

    def add(self, rate: float, cameras: Mapping[str, Publishers]) -> None:
        """Adds cameras with their publishers, at a rate [Hz]."""
        self._rates.append(_Rate(self._host, rate, cameras, self._fire))

    def clear(self) -> None:
        """Forgets what was due."""
        self._due.clear()

    def _fire(self, cameras: set[str]) -> None:
        self._due |= cameras
        if not any(rate.comes_yet for rate in self._rates):
            due, self._due = self._due, set()
            self._submit(due)


class _Rate:
    """The cameras of one rate."""

    def __init__(
        self, host: Host, rate: float, cameras: Mapping[str, Publishers], fire: Callable[[set[str]], None]
    ) -> None:
        self._host = host
        self._cameras = cameras
        self._fire = fire
        everything = [publisher for publishers in cameras.values() for publisher in publishers]
        self._timer: Timer = host.create_timer(1.0 / rate, self._call, while_matched=everything)

    @property
    def comes_yet(self) -> bool:
        """Whether its time has come at this very step, but its turn has not."""
        timer = self._timer
        return timer.due <= self._host.step and not timer.asleep and bool(self._listened())

    def _call(self) -> None:
        self._fire(self._listened())

    def _listened(self) -> set[str]:
        return {name for name, own in self._cameras.items() if any(publisher.matched for publisher in own)}
