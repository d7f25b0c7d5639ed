"""A host that lets a benchmark call the timer callback of a plugin."""

from collections.abc import Callable, Sequence
from typing import Any

from mjplug.physics.scheduler import Timer
from mjplug.plugin import Host, Publisher


class TimedHost(Host):
    """Stores the timer callback of a plugin and its publisher, to time the callback without the steps."""

    callback: Callable[[], None]
    publisher: Publisher[Any]

    def create_timer(
        self,
        period: float,
        callback: Callable[[], None],
        while_matched: Publisher[Any] | Sequence[Publisher[Any]] | None = None,
    ) -> Timer:
        """Stores both and creates the timer."""
        assert while_matched is not None
        assert not isinstance(while_matched, Sequence)
        self.callback, self.publisher = callback, while_matched
        return super().create_timer(period, callback, while_matched)
