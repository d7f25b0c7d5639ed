"""Topics in both directions. Both sides use CDR, so the bytes are passed on unchanged."""

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
_NO_ENCODING = "zenoh/bytes"
_CDR_STARTS = (b"\0\0", b"\0\1")


class ToRos:
    """A topic that the server publishes.

    The relay subscribes in Zenoh only while the ROS topic has subscribers, so that the server does not create messages
    without subscribers. It always subscribes to a latched topic, because late ROS subscribers need the last message.
    Each topic has its own thread for publishing, so that a slow topic delays neither the other topics nor the executor.
    If messages arrive faster than they are published, the oldest are dropped; the QoS depth is the length of the queue.

    Args:
        node: The ROS node that publishes.
        session: The session for the subscription.
        entry: The topic of the server.
        ros_name: Its name in ROS.
        message_type: Its ROS class.
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
        self._encodings = (f"{_CDR};{entry.type}", _CDR, _NO_ENCODING)
        self._open = True
        self._guard = threading.Lock()
        self._refused = 0
        self._failed = 0
        self.poll()

    def poll(self) -> None:
        """Subscribes or unsubscribes, depending on the number of ROS subscribers.

        Since Iron, rclpy can report changes of this number, but not with every RMW, so it is counted.
        """
        needed = self._entry.qos.latched or self._publisher.get_subscription_count() > 0
        if needed and self._subscriber is None:
            self._subscriber = self._subscribe()
        elif not needed:
            self._unsubscribe()

    def close(self, reason: str) -> None:
        """Stops the relay. Waiting messages are dropped.

        Args:
            reason: Not used, because a topic cannot report errors.
        """
        self._unsubscribe()
        with self._guard:
            self._open = False
        self._node.destroy_publisher(self._publisher)

    def _subscribe(self) -> Any:
        key, qos = self._entry.key, self._entry.qos
        self._newest = Newest(self._receive, qos.depth)
        # Called directly on Zenoh's thread, because otherwise zenoh would queue an unlimited number of messages.
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
                # After an interrupt, the context is shut down before the bridge is closed.
                if rclpy.ok():
                    self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Logs the first message that ROS refused; the thread must continue with the next messages."""
        self._failed += 1
        if self._failed == 1:
            self._node.get_logger().error(
                f"a message on the key {self._entry.key} could not be published in ROS: {error} (further failures are "
                "not logged)"
            )

    def _refuse(self, sample: zenoh.Sample, payload: bytes) -> None:
        """Drops a sample that is not a message of this type; logs the first one."""
        self._refused += 1
        if self._refused == 1:
            start = payload[:4].hex(" ") or "nothing"
            self._node.get_logger().warning(
                f"dropped a message on the key {self._entry.key}: its encoding is {str(sample.encoding)!r} and it "
                f"starts with {start}; expected {self._encodings[0]!r} (further dropped messages are not logged)"
            )


class ToServer:
    """A topic that the server subscribes to.

    Args:
        node: The ROS node that subscribes.
        session: The session for the publisher.
        entry: The topic of the server.
        ros_name: Its name in ROS.
        message_type: Its ROS class.
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
            # The executor must not wait if the network stalls.
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE if entry.qos.reliable else zenoh.Reliability.BEST_EFFORT,
            express=True,
        )

    def poll(self) -> None:
        """Does nothing: the relay exists only while the server subscribes to the topic."""

    def close(self, reason: str) -> None:
        """Stops the relay.

        Args:
            reason: Not used, because a topic cannot report errors.
        """
        self._node.destroy_subscription(self._subscription)
        self._publisher.undeclare()

    def _pass_on(self, payload: bytes) -> None:
        self._publisher.put(payload)
