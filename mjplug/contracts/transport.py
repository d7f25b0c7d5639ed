"""What the core asks of the wire: three kinds of endpoint, described by the names ROS users know.

`mjplug.wire` fulfils this with Zenoh; tests fulfil it with a fake. The core and the plugins see nothing else of it.
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
        depth: KEEP_LAST depth; a subscription with depth 1 delivers only the newest message.
        reliability: `reliable` or `best_effort`.
        durability: `transient_local` topics are latched: a late joiner gets the last `depth` samples.
    """

    depth: int = 10
    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"


DEFAULT = QoS()
"""What rclcpp and rclpy call the default profile: reliable, volatile, keep the last 10."""

LATEST = QoS(depth=1)
"""For command streams: only the newest message counts."""

CLOCK = QoS(depth=1, reliability="best_effort")
"""What rclcpp uses for /clock."""

LATCHED = QoS(depth=1, durability="transient_local")
"""For what a late joiner must still get."""


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """A topic: its full ROS name (`/a/b`), its message type and its quality of service."""

    name: str
    type: type[M]
    qos: QoS


@dataclass(frozen=True, slots=True)
class ServiceName:
    """A service: its full ROS name (`/a/b`) and its type."""

    name: str
    type: type[Service]


class Publisher(Protocol[M_contra]):
    """One topic that we publish. Called on the physics thread only."""

    @property
    def matched(self) -> bool:
        """Whether anybody listens; a message for nobody need not be built."""

    def publish(self, message: M_contra) -> None:
        """Encodes the message once per encoding that somebody listens to, and puts it."""

    def publish_frame(self, frame: CdrFrame) -> None:
        """Puts a prebuilt CDR frame; a JSON listener gets it decoded and re-encoded."""


class Call(Protocol):
    """One service request that waits for its answer. Answered once, from the physics thread."""

    @property
    def request(self) -> Message:
        """The decoded request."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """The selector's parameters: `{'wait': 'false'}` for `…?wait=false`."""

    def respond(self, response: Message) -> None:
        """Sends the response, in the encoding of the request; later answers are ignored."""

    def refuse(self, reason: str) -> None:
        """Answers that the request failed: `success=False` where the type has it, otherwise an error reply."""


class Transport(Protocol):
    """The network as the core sees it. Callbacks come on the transport's threads: they may only enqueue."""

    def open_publisher(self, topic: Topic[M], on_matched: Callable[[], None] | None = None) -> Publisher[M]:
        """Declares a publisher; `on_matched` is called each time a first listener appears."""

    def open_subscription(self, topic: Topic[M], deliver: Callable[[M], None]) -> None:
        """Declares a subscription; `deliver` gets every valid message."""

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service; `deliver` gets every valid request."""
