"""Actions: the three services and two topics of an action are mapped one by one, all of them or none.

Rclpy's ActionServer is not used: it keeps goals, their states and results itself, and would have to copy those of the
server. The five entities pass identifiers, states and results on unchanged, so the server alone decides about goals.
"""

from typing import Any

import zenoh

from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import ActionEntry, ServiceEntry, TopicEntry
from mjplug_bridge_ros2.ros_types import find_type
from mjplug_bridge_ros2.services import ServiceRelay
from mjplug_bridge_ros2.topics import ToRos

_NO_TIMEOUT = 1e9
"""Timeout of a request for a result, which the server answers when the goal has ended [s]."""

_GET_RESULT = "/_action/get_result"


class ActionRelay:
    """An action of the server.

    Args:
        node: The ROS node that provides the services and topics.
        handover: Calls functions on the thread of the node.
        session: The session for queries and subscriptions.
        entry: The action of the server.
        ros_name: Its name in ROS.
        timeout: Timeout of requests to send and to cancel goals [s].

    Raises:
        TypeRefused: The type is not installed, or its definition differs.
    """

    def __init__(
        self, node: Any, handover: Handover, session: zenoh.Session, entry: ActionEntry, ros_name: str, timeout: float
    ) -> None:
        self._relays: list[ServiceRelay | ToRos] = []
        # All types first, so that nothing is created if one of them is refused.
        parts: list[ServiceEntry | TopicEntry] = [*entry.services, *entry.topics]
        types = {part.name: find_type(part.type, part.hash) for part in parts}
        names = {name: ros_name + name[len(entry.name) :] for name in types}
        try:
            for service in entry.services:
                limit = _NO_TIMEOUT if service.name.endswith(_GET_RESULT) else timeout
                name = names[service.name]
                self._relays.append(ServiceRelay(node, handover, session, service, name, types[service.name], limit))
            for topic in entry.topics:
                self._relays.append(ToRos(node, session, topic, names[topic.name], types[topic.name]))
        except BaseException:
            self.close("the action cannot be mapped")
            raise

    def poll(self) -> None:
        """Subscribes to feedback while it has ROS subscribers."""
        for relay in self._relays:
            relay.poll()

    def close(self, reason: str) -> None:
        """Fails the waiting calls, and destroys the services and topics.

        Args:
            reason: The reason, for the error messages.
        """
        for relay in self._relays:
            relay.close(reason)
