"""A client with its own network address that stops reading after the first image: `stuck_subscriber.py ENDPOINT`."""

import json
import sys
import threading

import zenoh
from zenoh.handlers import Callback

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
# What other machines have not.
config.insert_json5("transport/shared_memory/enabled", "false")
released = threading.Event()


def stick(sample):
    print("stuck", flush=True)
    released.wait()


session = zenoh.open(config)
subscribers = [
    session.declare_subscriber(key, Callback(stick, indirect=False))
    for key in ("cameras/eye/color", "cameras/eye/depth", "clock")
]
sys.stdin.readline()
