"""What a plugin instance has declared. Endpoints outlive a restart of the plugin: it declares them again by name."""

from collections.abc import Callable, Hashable
from typing import Any, Protocol, TypeVar

from mjplug.contracts.topics import PublishedTopic
from mjplug.contracts.transport import Call, Publisher
from mjplug.physics.scheduler import Scheduler, Timer
from mjplug.plugin.prepared import Prepare

NOT_IN_MODEL = "the object that this belongs to is no longer in the model"
"""Why a request to an endpoint is refused that its plugin has not declared again."""


class PublishedEndpoint:
    """A publisher, and what its plugin wants from it.

    Attributes:
        timers: The timers that sleep while none of their publishers has a subscriber.
        on_matched: Called when the first subscriber appears; None for nothing.
        publisher: The publisher.
        published: The publisher for step requests.

    Args:
        scheduler: Wakes the timers.
        step: Returns the number of steps taken so far.
    """

    publisher: Publisher[Any]
    published: PublishedTopic

    def __init__(self, scheduler: Scheduler, step: Callable[[], int]) -> None:
        self.timers: list[Timer] = []
        self.on_matched: Callable[[], None] | None = None
        self._scheduler = scheduler
        self._step = step

    def matched(self) -> None:
        """Wakes the timers, and tells the plugin."""
        for timer in self.timers:
            self._scheduler.wake(timer, self._step())
        if self.on_matched is not None:
            self.on_matched()

    def release(self) -> None:
        """Separates the publisher from its plugin."""
        self.timers.clear()
        self.on_matched = None
        self.published.sample = self.published.remote = None


class ReadEndpoint:
    """A subscription.

    Attributes:
        callback: The plugin's function; None while the plugin has none.
        prepare: Prepares messages on another thread; None for nothing.
    """

    callback: Callable[[Any], None] | None = None
    prepare: Prepare | None = None

    def release(self) -> None:
        """Separates the subscription from its plugin."""
        self.callback = self.prepare = None


class ServedEndpoint:
    """A service; `handler` is the plugin's function, None while the plugin has none."""

    handler: Callable[[Any, Call], Any] | None = None

    def release(self) -> None:
        """Separates the service from its plugin."""
        self.handler = None


class Endpoint(Protocol):
    """Something that a plugin has declared."""

    def release(self) -> None:
        """Separates it from the plugin."""


E_ = TypeVar("E_", bound=Endpoint)


class Endpoints:
    """The endpoints of one plugin instance by kind, name and type. Several may have the same name."""

    def __init__(self) -> None:
        self._used: dict[Hashable, list[Endpoint]] = {}
        self._unused: dict[Hashable, list[Endpoint]] = {}

    def add(self, key: Hashable, endpoint: Endpoint) -> None:
        """Adds a new endpoint."""
        self._used.setdefault(key, []).append(endpoint)

    def take(self, key: Hashable, kind: type[E_]) -> E_ | None:
        """Returns an endpoint that the plugin had before it was restarted; None if there is none."""
        spare = self._unused.get(key)
        if not spare:
            return None
        endpoint = spare.pop(0)
        assert isinstance(endpoint, kind)
        self.add(key, endpoint)
        return endpoint

    def release_all(self) -> None:
        """Separates all endpoints from the plugin, before it is restarted."""
        for key, endpoints in self._used.items():
            for endpoint in endpoints:
                endpoint.release()
            self._unused.setdefault(key, []).extend(endpoints)
        self._used = {}
