"""The simulation view of a secured server: who may look, who may drag. Real Zenoh over TLS on 127.0.0.1."""

import queue
from dataclasses import dataclass, field

import pytest
import zenoh
from security.conftest import Client
from waits import TIMEOUT

from mjplug.wire.access import Interfaces
from mjplug.wire.network import Network, open_network
from mjplug.wire.secured import secured
from mjplug.wire.session import SessionSettings

VIEW = "mjplug/@view"


@dataclass
class Gate:
    """A server's network, and what has arrived there."""

    network: Network
    dragged: "queue.SimpleQueue[bytes]" = field(default_factory=queue.SimpleQueue)
    left: "queue.SimpleQueue[str]" = field(default_factory=queue.SimpleQueue)
    frames: "object" = None


@pytest.fixture
def gate(keys):
    settings = SessionSettings(listen=("tls/127.0.0.1:0",), config=keys.path / "server" / "server.json5")
    gate = Gate(open_network(secured(settings, lambda: Interfaces("/mjplug", [], [], [])), "/mjplug"))
    gate.frames = gate.network.open_bytes_publisher(f"{VIEW}/frame", "application/octet-stream", lambda: None)
    gate.network.open_bytes_queryable(f"{VIEW}/scene", lambda query: query.reply(b"a scene", "application/gzip"))
    gate.network.open_bytes_subscription(f"{VIEW}/drag", 100, gate.dragged.put)
    gate.network.watch_leaving(f"{VIEW}/viewer/*", gate.left.put)
    yield gate
    gate.network.close()


@pytest.fixture
def enter(keys, gate, opened):
    """Connects with the certificate of a user."""
    return lambda name: opened(Client(keys.path / f"{name}.json5", gate.network.session.endpoint))


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_a_viewer_and_an_operator_see_the_scene_and_its_frames(enter, gate, name):
    client = enter(name)
    assert client.ask(f"{VIEW}/scene") == [b"a scene"]
    frames = client.listen(f"{VIEW}/frame")
    client.settle()
    gate.frames.put(b"a frame")
    assert bytes(frames.get(timeout=TIMEOUT).payload) == b"a frame"


def test_an_operator_drags_and_a_viewer_does_not(enter, gate):
    for name in ("viewer", "operator"):
        client = enter(name)
        client.session.put(f"{VIEW}/drag", name.encode(), congestion_control=zenoh.CongestionControl.BLOCK)
        client.settle()
    assert gate.dragged.get(timeout=TIMEOUT) == b"operator"
    assert gate.dragged.empty()


def test_the_server_detects_that_an_operator_has_left(enter, gate):
    operator = enter("operator")
    operator.keep(operator.session.liveliness().declare_token(f"{VIEW}/viewer/ann"))
    operator.settle()
    operator.close()
    assert gate.left.get(timeout=TIMEOUT) == f"{VIEW}/viewer/ann"


def test_an_operator_may_own_the_steps_and_a_viewer_may_not(enter, gate):
    changes = queue.SimpleQueue()
    gate.network.watch_tokens("mjplug/@step/*", lambda token, present: changes.put((token, present)))
    for name in ("viewer", "operator"):
        client = enter(name)
        client.keep(client.session.liveliness().declare_token(f"mjplug/@step/{name}"))
        client.settle()
    assert changes.get(timeout=TIMEOUT) == ("mjplug/@step/operator", True)
    client.close()
    assert changes.get(timeout=TIMEOUT) == ("mjplug/@step/operator", False)
    assert changes.empty()


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_neither_a_viewer_nor_an_operator_publishes_frames_or_answers_for_the_scene(enter, gate, name):
    client, other = enter(name), enter("viewer")
    frames = other.listen(f"{VIEW}/frame")
    forge = zenoh.handlers.Callback(lambda query: query.reply(f"{VIEW}/scene", b"forged"), indirect=False)
    client.keep(client.session.declare_queryable(f"{VIEW}/scene", forge))
    other.settle()
    client.session.put(f"{VIEW}/frame", b"forged", congestion_control=zenoh.CongestionControl.BLOCK)
    client.settle()
    assert other.ask(f"{VIEW}/scene", target=zenoh.QueryTarget.ALL) == [b"a scene"]
    gate.frames.put(b"a frame")
    assert bytes(frames.get(timeout=TIMEOUT).payload) == b"a frame"
