"""The commands of the page on security make certificates with which a server and a client find each other."""

import shutil
import subprocess

import pytest
from docs.markdown import blocks_of
from docs.terminal import Reader

from mjplug.client import NoServerError, connect

PAGE = "security.md"


@pytest.fixture
def reader(tmp_path, monkeypatch):
    reader = Reader(PAGE, tmp_path)
    reader.save_files()
    # Zenoh takes the names of certificates from where the program was started.
    monkeypatch.chdir(tmp_path)
    yield reader
    reader.leave()


def test_a_client_with_the_authority_gets_in_by_tls_and_one_without_does_not(reader):
    assert shutil.which("openssl"), "Debian: apt-get install openssl"
    (commands,) = (block.text for block in blocks_of(PAGE) if block.language == "bash")
    subprocess.run(["bash", "-euc", commands], cwd=reader.folder, check=True, capture_output=True)
    line = "$ mjplug serve bundled:box --set zenoh.config=tls_server.json5 --listen tls/127.0.0.1:0"
    server = reader.server(line, as_it_is=True)
    assert server.endpoint.startswith("tls/127.0.0.1:")
    with connect(server.endpoint, config="tls_client.json5") as client:
        assert client.call("~/set_pause", paused=True).success
    with pytest.raises(NoServerError):
        connect(server.endpoint, timeout=0)
