"""A server's network on 127.0.0.1, and Zenoh clients that know nothing of mjplug."""

import json
import queue
import threading
from contextlib import ExitStack

import pytest
import zenoh
from waits import TIMEOUT

from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings

ANY_PORT = ("tcp/127.0.0.1:0",)


def client_config(endpoint):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    return config


class Answer:
    """A reply, taken apart."""

    def __init__(self, reply):
        part = reply.ok if reply.ok is not None else reply.err
        self.ok = reply.ok is not None
        self.payload = bytes(part.payload)
        self.encoding = str(part.encoding)
        self.key = str(reply.ok.key_expr) if self.ok else None

    @property
    def json(self):
        return json.loads(self.payload)

    @property
    def text(self):
        return self.payload.decode()


class Client:
    """A Zenoh session of somebody else."""

    def __init__(self, endpoint):
        self.session = zenoh.open(client_config(endpoint))
        self._kept = []

    def ask(self, selector, payload=None, **options):
        """All replies to a query, sent once somebody can answer it."""
        key = str(selector).partition("?")[0]
        self._await_match(self.session.declare_querier(key))
        options.setdefault("timeout", TIMEOUT)
        return [Answer(reply) for reply in self.session.get(selector, payload=payload, **options)]

    def call(self, selector, payload=None, **options):
        """The one reply to a query."""
        (answer,) = self.ask(selector, payload, **options)
        return answer

    def listen(self, key):
        """A queue of the samples that come in on a key."""
        samples = queue.SimpleQueue()
        self._kept.append(self.session.declare_subscriber(key, zenoh.handlers.Callback(samples.put, indirect=False)))
        return samples

    def publisher(self, key):
        """A publisher, once somebody listens to it."""
        publisher = self.session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
        self._kept.append(publisher)
        self._await_match(publisher)
        return publisher

    def settle(self):
        """Returns once the client knows everything that the server has declared so far, and the other way round."""
        self.call("mjplug/interfaces")

    def _await_match(self, declared):
        matched = threading.Event()
        listener = declared.declare_matching_listener(
            zenoh.handlers.Callback(lambda status: matched.set() if status.matching else None, indirect=False)
        )
        assert matched.wait(TIMEOUT), f"nobody is there for {declared.key_expr}"
        listener.undeclare()

    def close(self):
        self.session.close()


@pytest.fixture
def opened():
    """Opens networks and clients, and closes them in reverse."""
    with ExitStack() as stack:

        def keep(closeable):
            stack.callback(closeable.close)
            return closeable

        yield keep


@pytest.fixture
def new_network(opened):
    """Opens a network of some name; without further settings, a router on a free port."""

    def open_one(name="/mjplug", listen=ANY_PORT, max_open_calls=4096, **settings):
        return opened(open_network(SessionSettings(listen=listen, **settings), name, max_open_calls=max_open_calls))

    return open_one


@pytest.fixture
def new_ros_network(opened):
    """Opens a network that ROS 2 nodes see, a router on a free port."""

    def open_one(name="/mjplug", domain_id=0, distro="jazzy"):
        return opened(open_network(SessionSettings(listen=ANY_PORT), name, ros2=RosSettings(domain_id, distro)))

    return open_one


@pytest.fixture
def client_of(opened):
    """Opens a client at an endpoint."""
    return lambda endpoint: opened(Client(endpoint))


@pytest.fixture
def network(new_network):
    return new_network()


@pytest.fixture
def client(network, client_of):
    return client_of(network.session.endpoint)
