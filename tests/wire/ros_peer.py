"""What the tests of the rmw_zenoh dialect share: names, and what a bare Zenoh peer does in place of a node."""

import queue

import zenoh
from waits import TIMEOUT

from mjplug.contracts.transport import DEFAULT, Topic
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger

ANY_PORT = ("tcp/127.0.0.1:0",)

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
WRENCH_HASH = "RIHS01_3ced9bbef0a495b94e0ebe367964b04cd15ff52376462634600793fb05026982"
HEARTBEAT_KEY = f"0/mujoco_heartbeat/std_msgs::msg::dds_::String_/{STRING_HASH}"
WRENCH_TYPE = "mujoco_ros2_control_msgs::srv::dds_::ApplyExternalWrench_"
WRENCH_KEY = f"0/external_wrench/apply_wrench/{WRENCH_TYPE}/{WRENCH_HASH}"
TRIGGER_KEY = RosSettings().data_key("/trigger", Trigger)

HEARTBEAT = Topic("/mujoco_heartbeat", String, DEFAULT)
WHO = bytes(range(100, 116))


class Matched:
    """An event for each first listener."""

    def __init__(self):
        self._events = queue.SimpleQueue()

    def __call__(self):
        self._events.put(None)

    def wait(self):
        self._events.get(timeout=TIMEOUT)


def tokens(client, key="@ros2_lv/**"):
    """All tokens but those of the services that every node has."""
    replies = client.session.liveliness().get(key, timeout=TIMEOUT)
    return sorted(token for token in (str(reply.ok.key_expr) for reply in replies) if "_interfaces::" not in token)


def request(client, key, payload, attachment, target=zenoh.QueryTarget.ALL_COMPLETE):
    """What a client of rmw_zenoh sends; the one reply."""
    replies = client.session.get(
        key,
        payload=payload,
        attachment=attachment,
        target=target,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=TIMEOUT,
    )
    (reply,) = list(replies)
    return reply
