"""Publishers of the client."""

import threading
from typing import Any, Generic, TypeVar, cast

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError
from mjplug.client.timeouts import bounded
from mjplug.client.types import as_message, to_json
from mjplug.wakeup import Flag
from mjplug.wire.encoding import encoding_of
from mjplug.wire.origin import Attachments, host_id, no_time

M = TypeVar("M")


class Publisher(Generic[M]):
    """Publishes messages on one topic. Thread-safe.

    Attributes:
        name: The topic's full name.
        type: The message class; `dict` for nested dictionaries, which are sent as JSON.
        closed: Whether it has been closed.

    Args:
        session: The session.
        name: As above.
        key: The topic's key.
        type: As above.
    """

    def __init__(self, session: zenoh.Session, name: str, key: str, type: type[M]) -> None:
        self.name = name
        self.type = type
        self.closed = False
        # Untyped, because mypy does not allow `dict` here.
        self._class = cast(Any, type)
        json = type is dict
        self._publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding.APPLICATION_JSON if json else encoding_of("cdr", self._class),
            # Commands are rare, and none may be lost.
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
        )
        self._attachments = Attachments(host_id(session, ""), no_time)
        # Zenoh refuses to undeclare a publisher while it sends. If Ctrl-C interrupts a thread that holds the lock, this
        # thread can still close the publisher.
        self._lock = threading.RLock()
        self._matched = Flag()
        self._listener = self._publisher.declare_matching_listener(Callback(self._changed, indirect=False))

    @property
    def matched(self) -> bool:
        """Whether the topic has a subscriber."""
        return bool(self._matched)

    def wait_for_subscriber(self, timeout: float | None = None) -> bool:
        """Waits until the topic has a subscriber.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Returns:
            Whether the topic has a subscriber.
        """
        return self._matched.wait(None if timeout is None else bounded(timeout))

    def publish(self, message: "M | dict[str, Any]") -> None:
        """Sends a message.

        Args:
            message: The message, or nested dictionaries of its fields; missing fields have their initial values.

        Raises:
            WrongTypeError: The message does not match the topic's type.
            ClientError: The publisher is closed.
        """
        payload = to_json(message) if self._class is dict else as_message(message, self._class).to_cdr()
        with self._lock:
            if self.closed:
                raise ClientError(f"the publisher of {self.name} is closed")
            self._publisher.put(payload, attachment=self._attachments.next())

    def close(self) -> None:
        """Stops publishing; a second call does nothing."""
        with self._lock:
            if not self.closed:
                self.closed = True
                # zenoh's stubs leave the return type open.
                self._publisher.undeclare()  # type: ignore[no-untyped-call]

    def __enter__(self) -> "Publisher[M]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _changed(self, status: zenoh.MatchingStatus) -> None:
        if status.matching:
            self._matched.set()
        else:
            self._matched.clear()
