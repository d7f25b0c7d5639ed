"""Routers that end and come back: `mjplug router`, and servers that meet on one port."""

import signal
import subprocess
import time

import pytest
import warm_python
from cli.process import COMMAND, STARTING, STOPPING, Lines, environment

from mjplug.client import ClientError, connect
from mjplug.wire.endpoints import on_free_port

BACK = 60.0
"""How long it may take on a busy machine until a server is reached again [s]; Zenoh tries every 4 s at the latest."""


class Router:
    """A running `mjplug router`."""

    def __init__(self, endpoint, cwd):
        self.process = warm_python.popen(
            COMMAND, ("router", "--listen", endpoint),
            cwd=cwd, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)
        ready = self.out.wait_for(r"^ready · (\S+) · router$", STARTING)
        self.endpoint = ready[1]

    def end(self, number):
        self.process.send_signal(number)
        return self.process.wait(STOPPING)


@pytest.fixture
def route(tmp_path):
    """Starts routers, and kills those that still run."""
    routers = []

    def start(endpoint):
        routers.append(Router(endpoint, tmp_path))
        return routers[-1]

    yield start
    for router in routers:
        router.process.kill()
        router.process.wait()


def call_until_answered(client, name):
    """Repeats a call until it succeeds, and returns the response."""
    until = time.monotonic() + BACK
    while True:
        try:
            return client.call(name, paused=False, check=False, timeout=5.0).message
        except ClientError:
            assert time.monotonic() < until
            time.sleep(0.2)


def test_a_router_ends_with_code_0_and_its_port_is_free_then(route):
    first = route("tcp/127.0.0.1:0")
    assert first.endpoint.startswith("tcp/127.0.0.1:")
    assert first.end(signal.SIGTERM) == 0
    assert route(first.endpoint).end(signal.SIGINT) == 0


def test_a_router_where_zenoh_listens_already_is_refused(route, cli):
    first = route("tcp/127.0.0.1:0")
    done = cli("router", "--listen", first.endpoint)
    assert (done.returncode, done.stdout) == (5, "")
    assert f"error: a Zenoh router or server already listens on {first.endpoint}" in done.stderr


def test_a_server_survives_its_router_and_reports_when_it_is_back(route, serve):
    router = route("tcp/127.0.0.1:0")
    server = serve("bundled:box", listen=["--connect", router.endpoint])
    assert server.endpoint == router.endpoint
    with connect(router.endpoint, timeout=STARTING) as client:
        clock = client.subscribe("/clock")
        clock.next(STARTING)
        router.process.kill()
        assert server.err.wait_for(r"the connection to the Zenoh router at \S+ is lost", STARTING)
        assert server.running
        route(router.endpoint)
        assert server.err.wait_for(rf"the connection to the Zenoh router at {router.endpoint} is back", BACK)
        assert call_until_answered(client, "/mjplug/set_pause") == "the simulation is already running"
        clock.latest()
        before = clock.latest().clock.sec
        while clock.next(BACK).clock.sec <= before:
            pass
    assert "hosts" not in server.err.text


def test_when_the_first_of_three_servers_is_killed_the_others_are_reached_at_the_same_place(serve):
    endpoint = on_free_port("tcp/127.0.0.1:0")
    servers = {
        name: serve("bundled:box", "--set", f"node_name={name}", listen=["--listen", endpoint])
        for name in ("first", "second", "third")
    }
    assert {server.endpoint for server in servers.values()} == {endpoint}
    with connect(endpoint, timeout=STARTING) as client:
        servers["first"].kill()
        for name in ("second", "third"):
            assert call_until_answered(client, f"/{name}/set_pause") == "the simulation is already running"
        # One of the two hosts the router; the first comes back as a client of that.
        texts = [servers[name].err.text for name in ("second", "third")]
        assert sum("this server now hosts the Zenoh router at" in text for text in texts) == 1
        again = serve("bundled:box", "--set", "node_name=first", listen=["--listen", endpoint])
        assert again.endpoint == endpoint
        assert call_until_answered(client, "/first/set_pause") == "the simulation is already running"
    for server in (servers["second"], servers["third"], again):
        assert server.stop(within=2 * STOPPING) == 0
