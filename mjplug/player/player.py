"""Plays the messages of a bag in their order and pace."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Literal, Protocol

from mjplug.bag.reader import Bag, BagMessage
from mjplug.player.pace import Pace

Key = Literal["pause", "next", "faster", "slower", "stop"]
"""What a user can do during the playback."""

_FASTER = 1.1
_MAX_WAIT = 0.5
"""Maximum time between two looks at the keys [s]."""

_REMEMBERED = 256
"""Maximum number of latched messages of a topic that are recognized when the next file repeats them."""


class Publishing(Protocol):
    """Publishes messages; `mjplug.player.outputs.Outputs` implements it."""

    def publish(self, topic: str, data: bytes) -> bool:
        """Publishes a message; returns whether its topic is played."""

    def publish_clock(self, time_ns: int) -> None:
        """Publishes a time on `/clock`, if the playback does so."""

    def publish_epoch(self, epoch: int) -> None:
        """Publishes the number of jumps of the time."""


class _StopError(Exception):
    """The user ends the playback."""


class Player:
    """Plays a bag.

    Attributes:
        pace: The pace.
        played: Number of messages that were published.
        position: Log time of the last message [ns].
        epoch: Number of jumps of the time, as after a reset: at the end of a loop, and where the bag itself jumps back.

    Args:
        bag: The bag.
        topics: Names of the topics to play.
        pace: The pace.
        keys: Waits for at most a number of seconds, and returns what the user did.
        loop: Whether to begin again at the end.
        start_offset_ns: Time of the bag that is left out at its beginning [ns]; latched messages are played.
        clock_rate: Rate of `/clock` [Hz of wall time]; 0 for none.
    """

    def __init__(
        self,
        bag: Bag,
        topics: frozenset[str],
        pace: Pace,
        keys: Callable[[float], list[Key]],
        loop: bool = False,
        start_offset_ns: int = 0,
        clock_rate: float = 0.0,
    ) -> None:
        self.pace = pace
        self.played = 0
        self.position = 0
        self.epoch = 0
        self._bag = bag
        self._topics = topics
        self._keys = keys
        self._loop = loop
        self._offset_ns = start_offset_ns
        self._clock_period = 1.0 / clock_rate if clock_rate > 0.0 else 0.0
        self._next_clock = 0.0
        self._steps = 0

    def now(self) -> tuple[int, int]:
        """Returns log time and epoch, for the attachments of messages; a `mjplug.wire.origin.Now`."""
        return self.position, self.epoch

    def run(self, outputs: Publishing) -> bool:
        """Plays the bag; returns whether it was played to its end.

        Raises:
            BagError: A file is damaged.
        """
        outputs.publish_epoch(self.epoch)
        try:
            while True:
                played = self.played
                self._run_once(outputs)
                if not self._loop or self.played == played:
                    return True
        except _StopError:
            return False

    def _run_once(self, outputs: Publishing) -> None:
        begun = False
        for message in self._messages():
            if not begun or message.log_time < self.position:
                if self.played:
                    self.epoch += 1
                    self.position = message.log_time
                    outputs.publish_epoch(self.epoch)
                self.pace.start(message.log_time, time.monotonic())
                begun = True
            self._wait_for(message.log_time, outputs)
            self.position = message.log_time
            self.played += outputs.publish(message.topic.name, message.data)

    def _wait_for(self, log_time: int, outputs: Publishing) -> None:
        """Waits until a message is due, or the user wants the next one."""
        while True:
            now = time.monotonic()
            left = self.pace.wait(log_time, now)
            if self._clock_period and now >= self._next_clock:
                outputs.publish_clock(min(self.pace.position(now), log_time))
                self._next_clock = max(self._next_clock + self._clock_period, now)
            if self._steps:
                self._steps -= 1
                self.pace.start(log_time, now)
                return
            wait = min(left, _MAX_WAIT)
            if self._clock_period:
                wait = min(wait, max(0.0, self._next_clock - now))
            # Keys are read before each message too, so that a bag with a late message can be stopped.
            self._handle(self._keys(wait))
            if left <= 0.0 and not self.pace.paused:
                return

    def _handle(self, keys: list[Key]) -> None:
        now = time.monotonic()
        for key in keys:
            if key == "stop":
                raise _StopError
            if key == "pause":
                self.pace.pause(not self.pace.paused, now)
            elif key == "next":
                self._steps += self.pace.paused
            else:
                self.pace.set_rate(self.pace.rate * (_FASTER if key == "faster" else 1.0 / _FASTER), now)

    def _messages(self) -> Iterator[BagMessage]:
        """Yields the messages to play: from the offset on, and without latched ones that a next file repeats."""
        start: int | None = None
        seen: dict[str, deque[tuple[int, bytes]]] = {}
        before: dict[str, deque[BagMessage]] = {}
        file = -1
        repeating = False
        for message in self._bag.messages(self._topics):
            if message.file != file:
                file, repeating = message.file, message.file > 0
            start = message.log_time + self._offset_ns if start is None else start
            if message.topic.latched:
                known = seen.setdefault(message.topic.name, deque(maxlen=_REMEMBERED))
                if repeating and (message.sequence, message.data) in known:
                    continue
                known.append((message.sequence, message.data))
            else:
                repeating = False
            if self._offset_ns and message.log_time < start:
                if message.topic.latched:
                    before.setdefault(message.topic.name, deque(maxlen=_REMEMBERED)).append(message)
                continue
            for kept in before.values():
                for old in kept:
                    yield BagMessage(old.topic, message.log_time, old.publish_time, old.sequence, old.data, old.file)
            before.clear()
            yield message
