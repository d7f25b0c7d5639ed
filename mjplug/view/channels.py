"""The topics that one page subscribes to."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from mjplug.client.errors import ClientError
from mjplug.client.types import known
from mjplug.view.network import Network
from mjplug.view.outbox import MAX_SAMPLES, Outbox, SampleSlot, Slot
from mjplug.view.values import shown
from mjplug_schemas.errors import CodecError

MODES = ("newest", "all", "image")

MAX_CHANNELS = 64
"""Maximum number of subscriptions of one page."""

_MAX_NUMBER = 0xFFFF
"""The largest number of a channel."""


class Channel(Protocol):
    """A subscription of a page; also a `mjplug.view.feeds.Listener`.

    Attributes:
        slot: Where its items wait.
    """

    slot: Slot

    @property
    def wants_all(self) -> bool:
        """Whether it needs every sample."""

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Takes samples."""


class Samples:
    """Passes the CDR samples of a topic to the page.

    Args:
        number: Number of the channel.
        type: The type of the topic.
        all: Whether every sample is needed.
        outbox: The outbox of the page.
    """

    def __init__(self, number: int, type: str, all: bool, outbox: Outbox) -> None:
        self.slot: Slot = SampleSlot(number, MAX_SAMPLES if all else 1)
        self._type = type
        self._all = all
        self._outbox = outbox

    @property
    def wants_all(self) -> bool:
        """Whether every sample is needed."""
        return self._all

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Passes samples on; those that are not CDR and cannot be converted count as lost."""
        usable = [cdr for payload in payloads if (cdr := self._cdr(payload)) is not None]
        lost += len(payloads) - len(usable)
        if usable:
            assert isinstance(self.slot, SampleSlot)
            self.slot.add(usable, lost)
            self._outbox.fill(self.slot)

    def _cdr(self, payload: bytes) -> bytes | None:
        # CDR begins with a zero. A client may publish JSON on the same key.
        if payload[:1] == b"\0":
            return payload
        kind = known(self._type)
        if kind is None:
            return None
        try:
            cdr: bytes = bytes(kind.from_json(payload).to_cdr())
        except CodecError:
            return None
        return cdr


class Channels:
    """The subscriptions of one page.

    Args:
        network: The network.
        outbox: The outbox of the page.
        image: Creates the channel of an image topic from its number and the type of the topic.
    """

    def __init__(self, network: Network, outbox: Outbox, image: Callable[[int, str], Channel]) -> None:
        self._network = network
        self._outbox = outbox
        self._image = image
        self._open: dict[int, tuple[str, int, Channel]] = {}
        self._last = 0
        self._suspended = False

    async def subscribe(self, name: object, mode: object, server: object = None) -> dict[str, Any]:
        """Subscribes to a topic.

        Args:
            name: The topic.
            mode: One of `MODES`.
            server: Id of the server for `~`.

        Returns:
            The number of the channel, the type of the topic, and the definition of the type.

        Raises:
            ClientError: There is no such topic, or its type cannot be used; or there are too many subscriptions.
        """
        if mode not in MODES:
            raise ClientError(f"mode is {shown(mode)}; it must be one of: {', '.join(MODES)}")
        topic = await self._network.servers.topic(self._network.servers.resolve(name, server))
        definition = (await self._network.definitions(topic.type))["definition"]
        # After the last wait, so that a page cannot exceed the limit with requests at the same time.
        if len(self._open) >= MAX_CHANNELS:
            raise ClientError(f"{MAX_CHANNELS} topics are subscribed to, which is the maximum")
        number = self._number()
        if mode == "image":
            channel: Channel = self._image(number, topic.type)
        else:
            channel = Samples(number, topic.type, mode == "all", self._outbox)
        history = topic.depth * max(1, len(topic.publishers)) if topic.latched else 0
        self._open[number] = topic.key, history, channel
        if not self._suspended:
            self._network.feeds.add(topic.key, channel, history)
        return {"channel": number, "type": topic.type, "definition": definition}

    def unsubscribe(self, number: object) -> None:
        """Ends a subscription.

        Raises:
            ClientError: There is no such channel.
        """
        if not isinstance(number, int) or number not in self._open:
            there = ", ".join(map(str, self._open)) or "none"
            raise ClientError(f"channel is {shown(number)}; open channels: {there}")
        key, _, channel = self._open.pop(number)
        if not self._suspended:
            self._network.feeds.remove(key, channel)
        self._outbox.discard(channel.slot)

    def suspend(self) -> None:
        """Ends the Zenoh subscriptions until `resume`."""
        self._suspended = True
        for key, _, channel in self._open.values():
            self._network.feeds.remove(key, channel)

    def resume(self) -> None:
        """Subscribes again."""
        self._suspended = False
        for key, history, channel in self._open.values():
            self._network.feeds.add(key, channel, history)

    def close(self) -> None:
        """Ends all subscriptions."""
        if not self._suspended:
            self.suspend()
        self._open.clear()

    def _number(self) -> int:
        while True:
            self._last = self._last % _MAX_NUMBER + 1
            if self._last not in self._open:
                return self._last
