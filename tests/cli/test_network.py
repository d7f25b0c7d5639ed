"""How servers find a place on the network: ports that are taken, servers side by side, names that are in use."""

import socket

import pytest
from cli.client import Client
from cli.process import Served


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A server that others meet on its port."""
    server = Served("bundled:box", "--plugin", "heartbeat", cwd=tmp_path_factory.mktemp("first"))
    yield server
    server.kill()


def test_a_second_server_on_the_same_port_joins_the_first(first, serve, connect):
    second = serve(
        "bundled:box", "--set", "node_name=second", "--plugin", "external_wrench",
        listen=["--listen", first.endpoint],
    )  # fmt: skip
    # Clients of both connect to the same place.
    assert second.endpoint == first.endpoint
    client = connect(first)
    assert client.do("second/set_pause", paused=True) == "the simulation is now paused"
    assert client.do("mjplug/set_pause", paused=False) == "the simulation is already running"
    assert client.ask("second/interfaces")["name"] == "/second"
    # Another node_name does not change the other names, and both servers warn about them.
    for server, other in ((first, "/second"), (second, "/mjplug")):
        assert server.err.wait_for(f"warning: this server and {other} on the same network use the same names: .*/clock")
    assert second.stop() == 0
    assert first.running


def test_a_second_server_of_the_same_name_is_refused_with_the_way_out(first, cli):
    done = cli("serve", "bundled:box", "--quiet", "--listen", first.endpoint)
    assert (done.returncode, done.stdout) == (5, "")
    assert done.stderr.startswith("error: a server named /mjplug is already on this network (Zenoh id ")
    assert done.stderr.endswith("stop it, or give this one another namespace, such as --set namespace=robot2\n")
    with Client(first.endpoint) as client:
        assert client.do("mjplug/set_pause", paused=False) == "the simulation is already running"


def test_a_name_is_free_again_when_its_server_was_killed(serve, connect):
    first = serve("bundled:box")
    first.kill()
    second = serve("bundled:box", listen=["--listen", first.endpoint])
    assert second.endpoint == first.endpoint
    assert connect(second).do("mjplug/set_pause", paused=True) == "the simulation is now paused"


def test_a_port_that_another_program_has_is_refused_with_a_free_one(cli):
    with socket.create_server(("127.0.0.1", 0)) as other:
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        done = cli("serve", "bundled:box", "--quiet", "--listen", endpoint)
    assert (done.returncode, done.stdout) == (5, "")
    assert f"error: {endpoint} is in use by another program that does not speak Zenoh" in done.stderr
    assert "choose another endpoint with --listen, such as --listen tcp/127.0.0.1:" in done.stderr
