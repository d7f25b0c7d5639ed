"""Servers to talk to. Each is a process of its own; those that tests share stand still between requests."""

import json
import time
from pathlib import Path

import pytest
from cli.attack import effects
from cli.client import Client
from cli.process import Served, run
from cli.tour import Tour

WORLD = Path(__file__).parent / "world"


@pytest.fixture
def cli(tmp_path):
    """Runs `mjplug` with some arguments to its end, in an empty folder."""

    def cli(*arguments, cwd=tmp_path, **options):
        return run(*arguments, cwd=cwd, **options)

    return cli


@pytest.fixture
def serve(tmp_path):
    """Starts servers, in an empty folder, and sees to their end."""
    servers = []

    def serve(*arguments, cwd=tmp_path, **options):
        servers.append(Served(*arguments, cwd=cwd, **options))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


@pytest.fixture
def connect():
    """Opens clients, and closes them."""
    clients = []

    def connect(server):
        clients.append(Client(server.endpoint))
        return clients[-1]

    yield connect
    for client in clients:
        client.session.close()


class World:
    """A server that stands still, so that a test decides about every step."""

    def __init__(self, server, client):
        self.server = server
        self.client = client

    def step(self, count=1):
        self.client.do("mjplug/step_simulation", steps=count)

    def state(self):
        return json.loads(self.client.do("probe/state"))

    def send_push(self, *wrenches, parameters=""):
        request = {"wrenches": {"external_wrenches": [*wrenches]}}
        return self.client.request(f"external_wrench/apply_wrench{parameters}", **request)


@pytest.fixture(scope="package")
def standing():
    server = Served(
        "scene.xml", "--paused", "--plugin", "external_wrench", "--plugin", "heartbeat",
        "--plugin", "probe:Probe:probe", cwd=WORLD,
    )  # fmt: skip
    with Client(server.endpoint) as client:
        yield World(server, client)
    server.kill()


@pytest.fixture
def world(standing):
    """The shared server, paused at its initial state."""
    assert standing.server.running
    standing.client.do("mjplug/set_pause", paused=True)
    standing.client.do("mjplug/reset_world")
    return standing


@pytest.fixture(scope="package")
def attacked():
    """A server that runs in real time: it has something to lose."""
    began = time.monotonic()
    server = Served(
        "scene.xml", "--plugin", "external_wrench", "--plugin", "probe:Probe:probe", "--plugin", "heartbeat",
        "--set", "plugins.heartbeat.update_rate=50.0", cwd=WORLD,
    )  # fmt: skip
    with Client(server.endpoint) as client:
        world = World(server, client)
        world.beats = client.listen("mujoco_heartbeat/@json")
        services = len(client.ask("mjplug/interfaces")["services"])
        yield world
    assert server.stop() == 0
    assert "Traceback" not in server.err.text
    # A flood of bad input is no flood of log lines: each kind of line, of each service, comes at most once in some
    # seconds.
    lines = 8 * services + 5 * (time.monotonic() - began)
    assert server.err.text.count("\n") < lines
    assert len(server.err.text) < 1000 * lines


@pytest.fixture
def target(attacked):
    """The server, which must be as it was when the test is over."""
    attacked.client.do("mjplug/reset_world")
    before = effects(attacked)
    yield attacked
    assert effects(attacked) == before
    assert attacked.server.running
    attacked.beats.forget()
    while b"Heartbeat #" not in attacked.beats.sample().payload.to_bytes():
        pass
    assert attacked.client.do("mjplug/set_pause", paused=True) == "the simulation is now paused"
    assert attacked.client.do("mjplug/set_pause", paused=False) == "the simulation is now running"


@pytest.fixture(scope="package")
def touring(tmp_path_factory):
    tour = Tour(tmp_path_factory.mktemp("tour"))
    yield tour
    assert tour.server.stop() == 0
    assert "Traceback" not in tour.server.err.text


@pytest.fixture
def tour(touring):
    """Somebody who types commands at a server that runs in real time, and leaves it so."""
    yield touring
    for words in (("resume",), ("speed", "1"), ("reset",)):
        touring.ask("sim", *words)
