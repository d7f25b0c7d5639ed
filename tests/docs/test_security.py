"""The commands of the page on security make certificates with which a server and a client find each other."""

import shutil
import subprocess

import pytest
from docs.markdown import blocks_of
from docs.terminal import Command, Reader

from mjplug.client import NoServerError, connect

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
