"""Converts the server's QoS to rclpy profiles that the parameters `qos_overrides.<topic>...` can change."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from mjplug_bridge_ros2.listing import QoS

_KINDS = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)


def profile(qos: QoS) -> QoSProfile:
    """Returns the QoS profile for a ROS publisher or subscription."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else DurabilityPolicy.VOLATILE,
    )


def overridable() -> QoSOverridingOptions:
    """Returns the options that make rclpy declare, read and check the override parameters."""
    return QoSOverridingOptions(_KINDS)
