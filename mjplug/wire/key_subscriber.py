"""What a subscription reads from: a key as it comes, or with what was published on it before."""

import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.contracts.transport import QoS


def declare_key_subscriber(session: zenoh.Session, key: str, handler: "Callback[zenoh.Sample]", qos: QoS) -> object:
    """Declares a subscriber as ROS's quality of service asks; it lives as long as the returned object.

    A latched topic's subscriber also gets the last `qos.depth` samples of publishers that were, or come, before it.
    """
    if qos.durability == "volatile":
        return session.declare_subscriber(key, handler)
    return declare_advanced_subscriber(
        session,
        key,
        handler,
        history=HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
        recovery=RecoveryConfig(periodic_queries=None, heartbeat=True) if qos.reliability == "reliable" else None,
        subscriber_detection=True,
    )
