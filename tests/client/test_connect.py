"""Getting onto a network, or hearing why not."""

import json
import re
import signal
import socket
import subprocess
import sys
import time

import pytest
import zenoh
from cli.process import Served, environment
from slow_listener import SlowListener
from waits import TIMEOUT

from mjplug.client import ClientError, NoServerError, TimedOutError, UnknownNameError, connect
from mjplug.wire.discovery import announced
from mjplug.wire.endpoints import on_free_port
from mjplug_schemas.rosgraph_msgs import Clock


@pytest.fixture
def closed_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


def test_a_client_imports_neither_mujoco_nor_numpy_nor_any_other_heavy_thing(tmp_path):
    code = "import sys, mjplug.client; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )
    imported = set(done.stdout.split())
    assert "mjplug.client.client" in imported
    heavy = {"mujoco", "cv2", "numpy", "typer", "rich", "yaml", "mjplug.core", "mjplug.server.server", "mjplug.plugin"}
    assert not imported & heavy


def test_no_server_is_reported_in_one_sentence_with_advice(closed_port):
    endpoint = f"tcp/127.0.0.1:{closed_port}"
    with pytest.raises(NoServerError) as error:
        connect(endpoint, timeout=0.0)
    assert str(error.value) == (
        f"connection refused by {endpoint}: no mjplug server listens there; start one (mjplug serve bundled:box "
        f"--listen {endpoint}), or give the endpoint that its `ready` line shows "
        "(--connect, MJPLUG_CONNECT, or connect(endpoint))"
    )


def test_waiting_for_a_server_ends_when_the_time_is_over(closed_port):
    began = time.monotonic()
    with pytest.raises(NoServerError):
        connect(f"tcp/127.0.0.1:{closed_port}", timeout=0.3)
    assert 0.3 <= time.monotonic() - began < TIMEOUT


def test_a_program_that_accepts_connections_and_never_answers_is_not_called_a_refusal():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        endpoint = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(NoServerError) as error:
            connect(endpoint, timeout=0.0)
    assert re.fullmatch(
        rf"{re.escape(endpoint)} did not answer within [\d.]+ s, but accepts connections: its server is stopped or "
        r"overloaded, or another program has the port \(mjplug doctor\)",
        str(error.value),
    )


def test_the_error_names_the_whole_time_that_the_client_waited():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        began = time.monotonic()
        with pytest.raises(NoServerError) as error:
            connect(f"tcp/127.0.0.1:{silent.getsockname()[1]}", timeout=1.5)
        spent = time.monotonic() - began
    seconds = re.search(r"did not answer within ([\d.]+) s", str(error.value))
    assert 1.5 <= float(seconds[1]) <= round(spent, 1) + 0.1


def test_a_port_that_is_out_of_range_is_named():
    # A socket would take port 99999 modulo 65536.
    with pytest.raises(NoServerError, match=r"tcp/127\.0\.0\.1:99999: port 99999 is out of range"):
        connect("tcp/127.0.0.1:99999", timeout=0.0)


def test_a_host_that_does_not_exist_is_named():
    with pytest.raises(NoServerError, match=r"cannot connect to tcp/no\.such\.host\.invalid:7447: "):
        connect("tcp/no.such.host.invalid:7447", timeout=0.0)


def test_a_server_that_needs_longer_for_each_handshake_is_reached(server):
    with SlowListener(server.endpoint, delay=1.5) as listener, connect(listener.endpoint, timeout=TIMEOUT) as client:
        assert client.nodes() == ["/mjplug"]
        assert listener.connections > 1


def test_a_server_that_stops_answering_is_not_a_network_without_topics(tmp_path, monkeypatch):
    monkeypatch.setattr(announced, "QUERY_TIMEOUT", 0.3)
    server = Served("bundled:box", "--paused", cwd=tmp_path)
    try:
        with connect(server.endpoint) as client:
            assert client.topic("/clock").publishers == ("/mjplug",)
            server.process.send_signal(signal.SIGSTOP)
            # A signal takes a moment to stop every thread.
            with pytest.raises(NoServerError, match=r"Zenoh did not answer within 0\.6 s at tcp/\S+: its server is"):
                all(client.topic("/clock") for _ in range(1000))
            server.process.send_signal(signal.SIGCONT)
            assert client.topic("/clock").publishers == ("/mjplug",)
    finally:
        server.kill()


def test_what_is_no_endpoint_is_shown_how_to_write_one():
    with pytest.raises(NoServerError, match=r"'127\.0\.0\.1:7447' is not a Zenoh endpoint; .*tcp/127\.0\.0\.1:7447"):
        connect("127.0.0.1:7447", timeout=0.0)
    with pytest.raises(ClientError, match=r"cannot use the Zenoh configuration file /no/such\.json5"):
        connect(config="/no/such.json5", timeout=0.0)


def test_a_router_without_a_server_is_distinguished_from_no_router():
    endpoint = on_free_port("tcp/127.0.0.1:0")
    config = zenoh.Config()
    for key, value in {
        "mode": '"router"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
    }.items():
        config.insert_json5(key, value)
    with zenoh.open(config), pytest.raises(NoServerError, match=r"Zenoh answers at .*, but no mjplug server is on"):
        connect(endpoint, timeout=0.0)


def test_a_client_may_start_before_its_server(tmp_path):
    endpoint = on_free_port("tcp/127.0.0.1:0")
    script = (
        "from mjplug.client import connect\n"
        f"with connect({endpoint!r}, timeout=30.0) as client:\n"
        "    client.wait_for('~/set_pause')\n"
        "    print(client.call('~/set_pause', paused=True).message)\n"
    )
    waiting = subprocess.Popen(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, text=True
    )
    server = Served("bundled:box", cwd=tmp_path, listen=("--listen", endpoint))
    try:
        assert waiting.communicate(timeout=TIMEOUT)[0] == "the simulation is now paused\n"
    finally:
        waiting.kill()
        server.kill()


def test_a_program_that_forgets_to_close_still_ends(server, tmp_path):
    script = (
        "import threading\n"
        "from mjplug.client import connect\n"
        f"client = connect({server.endpoint!r})\n"
        "seen = threading.Event()\n"
        "client.subscribe('/clock', callback=lambda message: seen.set())\n"
        "assert seen.wait(10.0)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment(), timeout=TIMEOUT, check=False)
    assert done.returncode == 0


def test_the_environment_names_the_endpoint_unless_the_program_does(server, monkeypatch):
    monkeypatch.setenv("MJPLUG_CONNECT", server.endpoint)
    with connect() as client:
        assert client.endpoint == server.endpoint
        assert client.nodes() == ["/mjplug"]
        assert client.server.name == "/mjplug"
        assert client.server.endpoint == server.endpoint


def test_the_tilde_needs_a_choice_where_several_servers_are(server, tmp_path):
    second = Served(
        "bundled:box", "--paused", "--set", "namespace=robot2", "--connect", server.endpoint, cwd=tmp_path
    )  # fmt: skip
    try:
        with connect(server.endpoint) as client:
            assert client.nodes() == ["/mjplug", "/robot2/mjplug"]
            assert client.topic("/clock").publishers == ("/mjplug", "/robot2/mjplug")
            with pytest.raises(ClientError, match=r"there are several servers: /mjplug, /robot2/mjplug; choose one"):
                client.call("~/set_pause", paused=True)
            assert client.call("/robot2/mjplug/set_pause", paused=True).message.endswith("already paused")
        with connect(server.endpoint, server="/robot2/mjplug") as client:
            assert client.resolve("~/epoch") == "/robot2/mjplug/epoch"
            assert client.call("~/step_simulation", steps=2).success
        with pytest.raises(UnknownNameError, match=r"unknown server '/robot3/mjplug', did you mean '/robot2/mjplug'"):
            connect(server.endpoint, server="/robot3/mjplug", timeout=0.0)
    finally:
        assert second.stop() == 0


def test_a_subscription_outlives_a_restart_of_its_server(tmp_path):
    listen = ("--listen", on_free_port("tcp/127.0.0.1:0"))
    first = Served("bundled:box", cwd=tmp_path, listen=listen)
    with connect(first.endpoint) as client, client.subscribe("/clock") as clock:
        assert clock.next(TIMEOUT) is not None
        assert client.call("~/set_pause", paused=False).success
        assert first.stop() == 0
        with pytest.raises(
            TimedOutError, match=r"/mjplug/set_pause did not answer; its server /mjplug may have stopped"
        ):
            client.call("~/set_pause", paused=False)
        with pytest.raises(NoServerError, match=r"no mjplug server is left on the network of tcp/\S+"):
            client.call("~/set_pause", paused=False)
        # Its time is zero.
        second = Served("bundled:box", "--paused", cwd=tmp_path, listen=listen)
        try:
            while clock.next(TIMEOUT) != Clock():
                pass
            assert client.wait_for("~/set_pause").server == "/mjplug"
            assert client.call("~/set_pause", paused=True).success
        finally:
            assert second.stop() == 0


def test_a_password_comes_from_a_zenoh_configuration_file(tmp_path):
    (tmp_path / "users.txt").write_text("simulator:secret\n")
    login = {"user": "simulator", "password": "secret"}
    (tmp_path / "server.json5").write_text(
        json.dumps({"transport": {"auth": {"usrpwd": {**login, "dictionary_file": "users.txt"}}}})
    )
    (tmp_path / "client.json5").write_text(json.dumps({"transport": {"auth": {"usrpwd": login}}}))
    server = Served("bundled:box", "--set", "zenoh.config=server.json5", cwd=tmp_path)
    try:
        with pytest.raises(NoServerError, match=r"accepts connections, but not this client: it may need a certificate"):
            connect(server.endpoint, timeout=0.0)
        with connect(server.endpoint, config=tmp_path / "client.json5") as client:
            assert client.nodes() == ["/mjplug"]
    finally:
        assert server.stop() == 0
