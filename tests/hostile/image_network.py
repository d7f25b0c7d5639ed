"""Processes of a network with large messages: `image_network.py serve|publish|read ENDPOINT [KEY...]`.

`serve` is a server's network with a service `/go`, and `/links`, which answers with the number of links. `publish` puts
1 MB on `/image` thirty times a second, as a worker process does. `read` subscribes, and is to be stopped.
"""

import json
import sys
import time
from queue import SimpleQueue

import zenoh
from zenoh.handlers import Callback

from mjplug.contracts.transport import ServiceName
from mjplug.wire.network import open_network
from mjplug.wire.session import SessionSettings, join
from mjplug_schemas.std_srvs import Trigger

LEASE_MS = 1000
"""How long a stopped reader is waited for, by what it announces; Zenoh's default is 10 s."""


def serve(endpoint):
    calls = SimpleQueue()
    network = open_network(SessionSettings(listen=(endpoint,)), "/mjplug")
    network.open_service(ServiceName("/go", Trigger), calls.put)
    network.open_service(ServiceName("/links", Trigger), calls.put)
    print(network.session.endpoint, flush=True)
    while True:
        calls.get().respond(Trigger.Response(success=True, message=str(len(network.session.zenoh.info.links()))))


def publish(endpoint):
    session = join(SessionSettings(), (endpoint,))
    images = session.declare_publisher(
        "image", congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.DATA_LOW
    )
    image = zenoh.ZBytes(bytes(1_000_000))
    print("publishing", flush=True)
    while True:
        images.put(image)
        time.sleep(1 / 30)


def read(endpoint, *keys):
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("transport/shared_memory/enabled", False),
        ("transport/link/tx/lease", LEASE_MS),
    ):
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    received = SimpleQueue()
    subscribers = [session.declare_subscriber(key, Callback(received.put, indirect=False)) for key in keys]
    received.get()
    print("reading", len(subscribers), flush=True)
    while True:
        received.get()


if __name__ == "__main__":
    {"serve": serve, "publish": publish, "read": read}[sys.argv[1]](*sys.argv[2:])
