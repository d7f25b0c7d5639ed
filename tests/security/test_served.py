"""`mjplug serve` with certificates: its worker processes, and the errors for invalid certificates."""

import json
import os
import re
from datetime import timedelta
from pathlib import Path

import pytest
import zenoh
from cli.process import Served, run
from security.conftest import Client
from waits import TIMEOUT

from mjplug.client import NoServerError, connect
from mjplug.security.certificates import make_authority, make_server
from mjplug.security.folder import KeyFolder
from mjplug.wire.endpoints import with_free_port
from mjplug.wire.zenoh_file import read_zenoh_file

WORLD = Path(__file__).parent.parent / "worker" / "world"
pytestmark = pytest.mark.timeout(240)

LISTEN = ("--listen", "tls/127.0.0.1:0")
NO_GL = {"MUJOCO_GL": "disable"}


@pytest.fixture
def serve():
    servers = []

    def serve(*arguments):
        words = ("scene.xml", "--plugin", "teller:Teller:teller", *arguments)
        servers.append(Served(*words, cwd=WORLD, env=NO_GL, listen=LISTEN))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


@pytest.fixture
def by_hand(tmp_path):
    """Makes what the page on security makes with openssl, and returns the server's and a client's file."""
    from datetime import UTC, datetime, timedelta

    authority = make_authority("our own authority")
    pair = make_server("simulator", authority, ["127.0.0.1"], datetime.now(UTC) + timedelta(days=1))
    for name, text in (("ca.pem", authority.certificate), ("server.pem", pair.certificate), ("server.key", pair.key)):
        (tmp_path / name).write_text(text)

    def make(**more):
        tls = {"listen_certificate": "server.pem", "listen_private_key": "server.key", **more}
        for name, settings in (("server.json5", tls), ("client.json5", {"root_ca_certificate": "ca.pem"})):
            told = {"transport": {"link": {"tls": settings}}}
            (tmp_path / name).write_text(json.dumps(told | ({"mode": "client"} if name == "client.json5" else {})))
        return tmp_path / "server.json5", tmp_path / "client.json5"

    return make


def hear(opened, file, server):
    client = opened(Client(file, server.endpoint))
    told = json.loads(bytes(client.listen("teller/positions/@json").get(timeout=TIMEOUT).payload))
    assert len(told["position"]) > 0
    assert "Traceback" not in server.err.text


def test_what_a_worker_publishes_arrives_over_tls_made_by_hand_from_any_folder(serve, by_hand, opened):
    server_file, client_file = by_hand(root_ca_certificate="ca.pem")
    assert Path.cwd() != server_file.parent != WORLD
    hear(opened, client_file, serve("--zenoh-config", str(server_file)))


def test_what_a_worker_publishes_arrives_with_the_certificates_of_keys_init(serve, keys, opened):
    server = serve("--zenoh-config", os.path.relpath(keys.path / "server" / "server.json5", WORLD))
    hear(opened, keys.path / "viewer.json5", server)


def test_a_worker_that_does_not_trust_the_server_says_what_to_add_in_one_line(serve, by_hand):
    server_file, _ = by_hand()
    server = serve("--zenoh-config", str(server_file))
    warning = server.err.wait_for(r"warning: .* has no root_ca_certificate, which the worker processes", TIMEOUT)
    assert "add transport.link.tls.root_ca_certificate" in warning.string
    line = server.err.wait_for(r"error: the worker process failed: (.*)", TIMEOUT)[1]
    assert re.search(
        r"do not trust the server's certificate: add the certificate of its authority to .*server.json5", line
    )
    assert "Traceback" not in server.err.text


def test_a_server_whose_certificate_has_expired_does_not_start(tmp_path):
    keys = KeyFolder.create(tmp_path / "keys", ["localhost"])
    keys.renew("server", days=-1.0)
    ended = run("serve", "bundled:box", "--zenoh-config", "keys/server/server.json5", *LISTEN, cwd=tmp_path)
    assert ended.returncode == 5
    last = ended.stderr.splitlines()[-1]
    assert re.match(r"error: the certificate of this server \(in \S*server.json5\) expired on 20\d\d-\d\d-\d\d ", last)
    assert "mjplug keys renew server" in last


def test_a_server_with_roles_does_not_join_another_one(serve, keys):
    file = str(keys.path / "server" / "server.json5")
    first = serve("--zenoh-config", file)
    second = run(
        "serve", "scene.xml", "--zenoh-config", file, "--set", "node_name=second", "-l", first.endpoint, cwd=WORLD
    )
    assert second.returncode == 5
    assert (
        "because the access rules there do not contain its topics; choose another endpoint with --listen"
        in second.stderr
    )


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ('{metadata: {mjplug: {roles: {alice: "king"}}}}', "'alice' has the unknown role 'king'; known: operator"),
        ('{metadata: {mjplug: {roles: {}}}}', "roles must be a mapping of names to roles"),
        ('{metadata: {mjplug: {roles: {alice: "viewer"}}}}', "has roles, but clients are not authenticated"),
        ('{metadata: {mjplug: {roles: "none.json"}}}', r"the roles in \S*none.json .* cannot be read"),
        ('{metadata: {mjplug: {worker: 3}}}', "a file name in metadata.mjplug is 3; it must be a string"),
        (
            '{metadata: {mjplug: {roles: {alice: "viewer"}}}, access_control: {enabled: true}}',
            "has both access_control and roles",
        ),
    ],
)  # fmt: skip
def test_wrong_roles_are_refused_at_the_start(tmp_path, told, sentence):
    (tmp_path / "zenoh.json5").write_text(told)
    ended = run("serve", "bundled:box", "--zenoh-config", "zenoh.json5", cwd=tmp_path)
    assert ended.returncode == 5
    assert re.search(sentence, ended.stderr)


def test_a_client_whose_certificate_is_not_valid_yet_gets_the_advice_to_compare_the_clocks(tmp_path, monkeypatch):
    keys = KeyFolder.create(tmp_path / "keys", ["localhost"])
    with monkeypatch.context() as ahead:
        # As on a machine whose clock is ahead of the server's.
        ahead.setattr("mjplug.security.certificates._MAX_CLOCK_SKEW", -timedelta(hours=1))
        file = keys.add("early", "viewer")
    config = read_zenoh_file(keys.path / "server" / "server.json5")
    endpoint = with_free_port("tls/localhost:0")
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    with zenoh.open(config), pytest.raises(NoServerError) as refused:
        connect(endpoint, config=file, timeout=0.0)
    assert re.search(
        r"early\.json5 as not valid now, but it is valid until 20.*; compare the clocks", str(refused.value)
    )
