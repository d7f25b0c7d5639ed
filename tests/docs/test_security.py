"""The commands of the page on security make certificates with which a server and a client find each other."""

import queue
import shutil
import subprocess
from contextlib import ExitStack, closing

import pytest
import zenoh
from docs.markdown import blocks_of
from docs.terminal import Command, Reader
from waits import until
from wire.conftest import client_config

from mjplug.client import NoServerError, TimedOutError, connect
from mjplug.contracts.transport import QoS, ServiceName, Topic
from mjplug.wire.network import open_network
from mjplug.wire.session import SessionSettings
from mjplug_schemas.std_msgs import Float64
from mjplug_schemas.std_srvs import Trigger

PAGE = "security.md"


@pytest.fixture
def reader(tmp_path, monkeypatch):
    reader = Reader(PAGE, tmp_path)
    reader.save_files()
    # Where the files are named from, by the page and by this test alike.
    monkeypatch.chdir(tmp_path)
    yield reader
    reader.leave()


def shell_blocks():
    return [block.text for block in blocks_of(PAGE) if block.language == "bash"]


@pytest.mark.timeout(240)
def test_the_commands_about_keys_match_the_page(reader):
    lines = [line for text in shell_blocks() for line in text.splitlines() if line.startswith("mjplug keys")]
    init, *later = (Command.parse(f"$ {line}") for line in lines)
    assert init.words[:3] == ["mjplug", "keys", "init"]
    printed = reader.run(init)
    shown = next(text for text in shell_blocks() if text.startswith("mjplug serve"))
    # The first line contains the endpoint for clients.
    assert printed.stdout.splitlines()[1:] == shown.splitlines()
    start, listed = shown.splitlines()
    server = reader.server(f"$ {start} --listen tls/127.0.0.1:0", as_it_is=True)
    topics = reader.run(Command.parse(f"$ {listed}"), server.endpoint)
    assert "/clock" in topics.stdout.splitlines()
    for command in later:
        ran = reader.run(command)
        assert ran.returncode == 0, ran.stdout


def test_a_client_with_the_authority_gets_in_by_tls_and_one_without_does_not(reader):
    assert shutil.which("openssl"), "Debian: apt-get install openssl"
    (commands,) = (text for text in shell_blocks() if text.startswith("openssl"))
    subprocess.run(["bash", "-euc", commands], cwd=reader.folder, check=True, capture_output=True)
    line = "$ mjplug serve bundled:box --zenoh-config tls_server.json5 --listen tls/127.0.0.1:0"
    server = reader.server(line, as_it_is=True)
    assert server.endpoint.startswith("tls/127.0.0.1:")
    with connect(server.endpoint, config="tls_client.json5") as client:
        assert client.call("~/set_pause", paused=True).success
    with pytest.raises(NoServerError):
        connect(server.endpoint, timeout=0)


@pytest.fixture
def limited(reader):
    """Serves with the file of limits for one network interface; gives the network and what arrives on /cmd_vel."""
    with ExitStack() as stack:

        def serve(interface):
            file = reader.folder / "limits.json5"
            file.write_text(file.read_text().replace("eth0", interface))
            settings = SessionSettings(listen=("tcp/127.0.0.1:0",), config=file)
            network = stack.enter_context(closing(open_network(settings, "/mjplug")))
            arrived = queue.SimpleQueue()
            network.open_subscription(
                Topic("/cmd_vel", Float64, QoS(depth=1000)), lambda message: arrived.put(message.data)
            )
            network.open_service(
                ServiceName("/mjplug/reset_world", Trigger),
                lambda call: call.respond(Trigger.Response(success=True, message="reset")),
            )
            return network, arrived

        yield serve


def flood(session, key, payload, count):
    for _ in range(count):
        session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)


def reset_often(client):
    # On a busy machine, half a second may pass between two calls.
    for _ in range(50):
        client.call("/mjplug/reset_world", timeout=60.0)


def count_until(arrived, last):
    """Counts what arrives before a last message."""
    count = 0
    while arrived.get(timeout=10.0) != last:
        count += 1
    return count


@pytest.mark.parametrize("form", ["cdr", "json"])
def test_the_limits_of_zenoh_hold_for_each_client_by_itself(limited, form):
    network, arrived = limited("lo")
    one, last = Float64(data=1.0), Float64(data=2.0)
    key, payload = ("cmd_vel", one.to_cdr()) if form == "cdr" else ("cmd_vel/@json", one.to_json())
    with zenoh.open(client_config(network.session.endpoint)) as greedy, connect(network.session.endpoint) as modest:
        modest.publisher("/cmd_vel").wait_for_subscriber(10.0)
        flood(greedy, key, payload, 3000)
        modest.publish("/cmd_vel", last)
        # Without limits, all 3000.
        assert count_until(arrived, 2.0) < 2900
        flood(greedy, key, payload + bytes(300_000), 1)
        assert modest.call("/mjplug/reset_world").message == "reset"
        with pytest.raises(TimedOutError, match="did not answer"):
            reset_often(modest)
    assert network.refused() == {"/cmd_vel": 0, "/mjplug/reset_world": 0}


def test_the_limits_of_zenoh_spare_the_worker_processes(limited):
    network, arrived = limited("eth0")
    with zenoh.open(client_config(network.session.endpoint)) as worker:
        publisher = worker.declare_publisher("cmd_vel", congestion_control=zenoh.CongestionControl.BLOCK)
        until(lambda: publisher.matching_status.matching)
        flood(worker, "cmd_vel", Float64(data=1.0).to_cdr(), 500)
        flood(worker, "cmd_vel", bytes(300_000), 1)
        flood(worker, "cmd_vel", Float64(data=2.0).to_cdr(), 1)
        assert count_until(arrived, 2.0) == 500
    assert network.refused()["/cmd_vel"] == 1
