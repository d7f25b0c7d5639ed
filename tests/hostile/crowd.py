"""Clients of a server that put large messages: `crowd.py ENDPOINT COUNT`. They have Zenoh's own settings.

Zenoh's default for shared memory is on. Prints a line when all have put, and ends when its input does.
"""

import json
import sys

import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
sessions = [zenoh.open(config) for _ in range(int(sys.argv[2]))]
for session in sessions:
    publisher = session.declare_publisher("cmd_vel", congestion_control=zenoh.CongestionControl.BLOCK)
    for _ in range(3):
        publisher.put(bytes(100_000))
    # Answered after what was put before it.
    assert list(session.get("mjplug/interfaces", timeout=20.0))
print("put", flush=True)
sys.stdin.readline()
