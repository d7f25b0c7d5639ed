"""Declares the Zenoh subscriber of a key: a plain one, or one with history for latched topics."""

import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.contracts.transport import QoS


def declare_key_subscriber(session: zenoh.Session, key: str, handler: "Callback[zenoh.Sample]", qos: QoS) -> object:
    """Declares a subscriber with ROS's quality of service; it exists as long as the returned object.

    The subscriber of a latched topic also gets the last `qos.depth` samples of every publisher, early or late.
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
