"""Clients that stop reading after the first message: `stuck_subscriber.py ENDPOINT COUNT`."""

import json
import sys
import threading

import zenoh
from zenoh.handlers import Callback

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
# As on another machine.
config.insert_json5("transport/shared_memory/enabled", "false")
released = threading.Event()


def stick(sample):
    print("stuck", flush=True)
    released.wait()


sessions = [zenoh.open(config) for _ in range(int(sys.argv[2]))]
subscribers = [
    session.declare_subscriber(key, Callback(stick, indirect=False))
    for session in sessions
    for key in ("cameras/eye/color", "cameras/eye/depth", "clock")
]
sys.stdin.readline()
