"""The subscriptions of a ROS 2 node, on bare Zenoh of any version since 1.5. Says in one JSON line what they got.

Arguments: the server's endpoint, the key of a latched topic of std_msgs/msg/String, how many messages to wait for on
each of the live keys, and the live keys.
"""

import json
import sys
import threading

import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

TIMEOUT = 10.0


def text_of(sample):
    """The text in a std_msgs/msg/String."""
    return bytes(sample.payload)[8:-1].decode()


def main():
    endpoint, latched_key, count, *live_keys = sys.argv[1:]
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    numbers, latched = {key: [] for key in live_keys}, []
    got_latched, got_all = threading.Event(), threading.Event()

    def hear_latched(sample):
        latched.append(text_of(sample))
        got_latched.set()

    def hear(sample):
        numbers[str(sample.key_expr)].append(int.from_bytes(bytes(sample.attachment)[:8], "little"))
        if all(len(heard) == int(count) for heard in numbers.values()):
            got_all.set()

    with zenoh.open(config) as session:
        kept = [
            declare_advanced_subscriber(
                session,
                latched_key,
                hear_latched,
                history=HistoryConfig(detect_late_publishers=True, max_samples=1),
                recovery=RecoveryConfig(periodic_queries=None, heartbeat=True),
                subscriber_detection=True,
            )
        ]
        assert got_latched.wait(TIMEOUT)
        kept += [session.declare_subscriber(key, hear) for key in live_keys]
        got_all.wait(TIMEOUT)
        print(json.dumps(["got", [latched, *numbers.values()]]), flush=True)
        del kept


if __name__ == "__main__":
    main()
