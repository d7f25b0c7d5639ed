"""Topics, in either direction. The bytes are CDR on both sides and pass as they are."""

import threading
from typing import Any

import rclpy
import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug_bridge_ros2.listing import TopicEntry
from mjplug_bridge_ros2.newest import Newest
from mjplug_bridge_ros2.qos import overridable, profile

_CDR = "application/cdr"
_UNSTATED = "zenoh/bytes"
_CDR_STARTS = (b"\0\0", b"\0\1")


class ToRos:
    """A topic that the server publishes.

    It subscribes in Zenoh only while somebody subscribes in ROS, so that the server does not even build messages that
    nobody reads; a latched topic is read always, since its last message is for those who come later. Messages are
    published on a thread of the topic: a topic that is slow or waits for its readers does not delay the others, nor
    does the executor. If publishing is slower than the messages arrive, the oldest are dropped, as the depth of the
    topic's quality of service says.

    Args:
        node: The node to publish with.
        session: The session to read with.
        entry: The topic.
        ros_name: What it is called in ROS.
        message_type: Its class.
    """

    def __init__(self, node: Any, session: zenoh.Session, entry: TopicEntry, ros_name: str, message_type: Any) -> None:
        self._node = node
        self._session = session
        self._entry = entry
        self._publisher = node.create_publisher(
            message_type, ros_name, profile(entry.qos), qos_overriding_options=overridable()
        )
        self._subscriber: Any = None
        self._newest: Newest | None = None
        self._encodings = (f"{_CDR};{entry.type}", _CDR, _UNSTATED)
        self._open = True
        self._guard = threading.Lock()
        self._refused = 0
        self._failed = 0
        self.poll()

    def poll(self) -> None:
        """Looks whether there are readers.

        Rclpy could tell of changes since Iron, but not with every RMW; counting works with all.
        """
        wanted = self._entry.qos.latched or self._publisher.get_subscription_count() > 0
        if wanted and self._subscriber is None:
            self._subscriber = self._subscribe()
        elif not wanted:
            self._unsubscribe()

    def close(self, reason: str) -> None:
        """Ends it. Messages that are under way are dropped.

        Args:
            reason: Not used: a topic has nobody to tell it to.
        """
        self._unsubscribe()
        with self._guard:
            self._open = False
        self._node.destroy_publisher(self._publisher)

    def _subscribe(self) -> Any:
        key, qos = self._entry.key, self._entry.qos
        self._newest = Newest(self._receive, qos.depth)
        # On Zenoh's own thread; otherwise zenoh would queue any number of messages.
        handler = Callback(self._newest.add, drop=None, indirect=False)
        if not qos.latched:
            return self._session.declare_subscriber(key, handler)
        return declare_advanced_subscriber(
            self._session,
            key,
            handler,
            history=HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
            recovery=RecoveryConfig(periodic_queries=None, heartbeat=True) if qos.reliable else None,
        )

    def _unsubscribe(self) -> None:
        if self._subscriber is not None:
            self._subscriber.undeclare()
            self._subscriber = None
        if self._newest is not None:
            self._newest.close()
            self._newest = None

    def _receive(self, sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        if str(sample.encoding) not in self._encodings or payload[:2] not in _CDR_STARTS:
            self._refuse(sample, payload)
            return
        with self._guard:
            if not self._open:
                return
            try:
                self._publisher.publish(payload)
            except Exception as error:
                # An interrupt takes the context away before the bridge hears of it.
                if rclpy.ok():
                    self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Says once that ROS refused a message; the thread must live on for those that follow."""
        self._failed += 1
        if self._failed == 1:
            self._node.get_logger().error(
                f"a message on the key {self._entry.key} could not be published in ROS, and others may follow that are "
                f"not reported: {error}"
            )

    def _refuse(self, sample: zenoh.Sample, payload: bytes) -> None:
        """Keeps from ROS what its readers would take for a message, and says so once."""
        self._refused += 1
        if self._refused == 1:
            start = payload[:4].hex(" ") or "nothing"
            self._node.get_logger().warning(
                f"dropped a message on the key {self._entry.key}, and will drop others like it without a word: its "
                f"encoding is {str(sample.encoding)!r} and it starts with {start}; expected {self._encodings[0]!r}"
            )


class ToServer:
    """A topic that the server subscribes to.

    Args:
        node: The node to subscribe with.
        session: The session to publish with.
        entry: The topic.
        ros_name: What it is called in ROS.
        message_type: Its class.
    """

    def __init__(self, node: Any, session: zenoh.Session, entry: TopicEntry, ros_name: str, message_type: Any) -> None:
        self._node = node
        self._subscription = node.create_subscription(
            message_type,
            ros_name,
            self._pass_on,
            profile(entry.qos),
            qos_overriding_options=overridable(),
            raw=True,
        )
        self._publisher: Any = session.declare_publisher(
            entry.key,
            encoding=zenoh.Encoding.APPLICATION_CDR.with_schema(entry.type),
            # The executor must not wait for a network that has stalled.
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE if entry.qos.reliable else zenoh.Reliability.BEST_EFFORT,
            express=True,
        )

    def poll(self) -> None:
        """Does nothing: the server is always there to read, or this would not be."""

    def close(self, reason: str) -> None:
        """Ends it.

        Args:
            reason: Not used: a topic has nobody to tell it to.
        """
        self._node.destroy_subscription(self._subscription)
        self._publisher.undeclare()

    def _pass_on(self, payload: bytes) -> None:
        self._publisher.put(payload)
