"""The interface between the server and its transport: publishers, subscriptions and services, in ROS's terms.

`mjplug.wire` implements it with Zenoh; tests implement it with a fake. The other folders use only this interface.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)
M_contra = TypeVar("M_contra", bound=Message, contravariant=True)


@dataclass(frozen=True, slots=True)
class QoS:
    """The ROS 2 quality of service of a topic.

    Attributes:
        depth: KEEP_LAST depth. A subscription with depth 1 delivers only the newest message.
        reliability: `reliable` or `best_effort`.
        durability: `volatile` or `transient_local`. On a `transient_local` (latched) topic, a late subscriber gets the
            last `depth` messages.
    """

    depth: int = 10
    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"


DEFAULT = QoS()
"""The default QoS profile of rclcpp and rclpy: reliable, volatile, keep last 10."""

LATEST = QoS(depth=1)
"""QoS of command topics, where only the newest message counts."""

CLOCK = QoS(depth=1, reliability="best_effort")
"""The QoS of `/clock` in rclcpp."""

LATCHED = QoS(depth=1, durability="transient_local")
"""QoS of topics whose last message a late subscriber must get."""


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """A topic: its full ROS name (such as `/a/b`), its message type and its quality of service."""

    name: str
    type: type[M]
    qos: QoS


@dataclass(frozen=True, slots=True)
class ServiceName:
    """A service: its full ROS name (such as `/a/b`) and its type.

    Attributes:
        name: The name.
        type: The service's class.
        packed: Whether sequences of numbers in CDR requests are memoryviews; see `Message.from_cdr`.
    """

    name: str
    type: type[Service]
    packed: bool = False


class Publisher(Protocol[M_contra]):
    """A publisher of one topic. Physics thread only.

    Attributes:
        tap: Also gets each published message or frame; None if nothing in this process reads the topic. It must copy
            a frame, because the frame's next values replace its content.
    """

    tap: "Callable[[Message | CdrFrame], None] | None"

    @property
    def matched(self) -> bool:
        """Whether the topic has a subscriber or a tap; if not, there is no need to build a message."""

    def publish(self, message: M_contra) -> None:
        """Publishes the message, encoded once for each encoding that has subscribers."""

    def publish_frame(self, frame: CdrFrame) -> None:
        """Publishes a prebuilt CDR frame; for JSON subscribers it is decoded and encoded again."""


class Call(Protocol):
    """A service request that waits for its response. It is answered once, on the physics thread."""

    @property
    def request(self) -> Message:
        """The decoded request."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """The parameters of the Zenoh selector: `{'wait': 'false'}` for `…?wait=false`."""

    @property
    def form(self) -> Literal["cdr", "json", "message"]:
        """The form in which the response is sent; `message` for a call in this process, which is not encoded."""

    def respond(self, response: Message) -> None:
        """Sends the response in the encoding of the request; later calls are ignored."""

    def respond_frame(self, frame: CdrFrame) -> None:
        """Sends a response whose numbers were written into a CDR frame; the frame may be changed afterwards."""

    def refuse(self, reason: str) -> None:
        """Reports that the request failed: with `success=False` if the type has this field, or with an error reply."""


class BytesPublisher(Protocol):
    """A publisher of bytes that are no ROS message. Its key is in no list of interfaces."""

    @property
    def matched(self) -> bool:
        """Whether the key has a subscriber."""

    def put(self, payload: bytes) -> None:
        """Publishes the bytes; a subscriber that is too slow loses them."""


class BytesQuery(Protocol):
    """A query that waits for its reply. Any thread may answer it; only the first answer counts."""

    def reply(self, payload: bytes, encoding: str, attachment: str = "") -> None:
        """Replies with bytes.

        Args:
            payload: The bytes.
            encoding: Zenoh encoding, such as `application/json`.
            attachment: Text that is sent as the attachment; empty means none.
        """

    def refuse(self, reason: str) -> None:
        """Sends an error reply with one sentence."""


class BytesTransport(Protocol):
    """Declares endpoints for bytes that are no ROS message. Callbacks run on the transport's threads."""

    def open_bytes_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> BytesPublisher:
        """Declares a publisher; `on_matched` is called each time the first subscriber appears."""

    def open_bytes_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Declares a subscription; `deliver` is called with every payload of at most `limit` bytes."""

    def open_bytes_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Declares a queryable; `deliver` is called with every query on exactly this key."""

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Calls `left` with the key of each liveliness token that disappears.

        Args:
            keys: Key expression of the tokens.
            left: Called with the token's key.
        """

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Watches liveliness tokens, including those that exist already.

        Args:
            keys: Key expression of the tokens.
            changed: Called with the key of each token, and true when it appears or false when it disappears.
        """


class Transport(BytesTransport, Protocol):
    """Declares publishers, subscriptions and services. Callbacks run on the transport's threads; they only enqueue."""

    def open_publisher(self, topic: Topic[M], on_matched: Callable[[], None] | None = None) -> Publisher[M]:
        """Declares a publisher; `on_matched` is called each time the first subscriber appears."""

    def open_subscription(self, topic: Topic[M], deliver: Callable[[M], None]) -> None:
        """Declares a subscription; `deliver` is called with every valid message."""

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service; `deliver` is called with every valid request."""
