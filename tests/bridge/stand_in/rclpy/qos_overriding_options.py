import contextlib

import rclpy.qos
from rclpy.exceptions import ParameterAlreadyDeclaredException
from rclpy.qos import QoSPolicyKind

_ENUMS = (QoSPolicyKind.RELIABILITY, QoSPolicyKind.HISTORY, QoSPolicyKind.DURABILITY)


class InvalidQosOverridesError(Exception):
    pass


class QoSOverridingOptions:
    def __init__(self, policy_kinds, *, callback=None, entity_id=None):
        if callback is not None or entity_id is not None:
            # What the callback returns differs between distributions.
            raise NotImplementedError
        self.policy_kinds = tuple(map(QoSPolicyKind, policy_kinds))


def declare(node, entity_type, topic, qos, options):
    for kind in options.policy_kinds if options is not None else ():
        policy = kind.name.lower()
        name = f"qos_overrides.{topic}.{entity_type}.{policy}"
        default = getattr(qos, policy)
        with contextlib.suppress(ParameterAlreadyDeclaredException):
            node.declare_parameter(name, default.name.lower() if kind in _ENUMS else default)
        value = node.get_parameter(name).value
        if kind in _ENUMS:
            try:
                value = getattr(rclpy.qos, f"{policy.capitalize()}Policy")[value.upper()]
            except KeyError:
                raise RuntimeError(f"Unexpected QoS override for policy `{policy}`: `{value}`") from None
        setattr(qos, policy, value)
