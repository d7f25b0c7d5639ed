"""The commands of the page on security make certificates with which a server and a client find each other."""

import queue
import shutil
import subprocess
from contextlib import closing

import pytest
import zenoh
from docs.markdown import blocks_of
from docs.terminal import Command, Reader
from wire.conftest import client_config

from mjplug.client import NoServerError, connect
from mjplug.transport import QoS, ServiceName, Topic
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
def test_the_commands_about_keys_do_what_the_page_says(reader):
    lines = [line for text in shell_blocks() for line in text.splitlines() if line.startswith("mjplug keys")]
    init, *later = (Command.parse(f"$ {line}") for line in lines)
    assert init.words[:3] == ["mjplug", "keys", "init"]
    printed = reader.run(init)
    shown = next(text for text in shell_blocks() if text.startswith("mjplug serve"))
    assert printed.stdout.splitlines() == shown.splitlines()
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


def test_the_limits_of_zenoh_hold_for_each_client_by_itself(reader):
    settings = SessionSettings(listen=("tcp/127.0.0.1:0",), config=reader.folder / "limits.json5")
    with closing(open_network(settings, "/mjplug")) as network:
        arrived = queue.SimpleQueue()
        network.open_subscription(Topic("/target", Float64, QoS(depth=1000)), lambda message: arrived.put(message.data))
        network.open_service(
            ServiceName("/go", Trigger), lambda call: call.respond(Trigger.Response(success=True, message="went"))
        )
        with zenoh.open(client_config(network.session.endpoint)) as greedy, connect(network.session.endpoint) as modest:
            modest.publisher("/target").wait_for_subscriber(10.0)
            payload = Float64(data=1.0).to_cdr()
            for _ in range(3000):
                greedy.put("target", payload, congestion_control=zenoh.CongestionControl.BLOCK)
            modest.publish("/target", Float64(data=2.0))
            got = 0
            while arrived.get(timeout=10.0) == 1.0:
                got += 1
            # Without limits, all 3000.
            assert got < 2900
            greedy.put("target", payload + bytes(300_000), congestion_control=zenoh.CongestionControl.BLOCK)
            assert modest.call("/go").message == "went"
        assert network.refused() == {"/target": 0, "/go": 0}
