"""`mjplug keys` and `mjplug doctor --security` on the command line."""

import json
import re
import sys

import pytest
from cli.process import Served, run

from mjplug.security.folder import KeyFolder

LISTEN = ("--listen", "tls/127.0.0.1:0")

WITHOUT_CRYPTOGRAPHY = (
    sys.executable,
    "-c",
    "import sys; sys.modules['cryptography'] = None; sys.argv[0] = 'mjplug'; from mjplug.cli import main; main()",
)


def test_init_prints_the_line_to_start_and_the_line_to_connect_and_both_work(tmp_path):
    made = run("keys", "init", "--host", "localhost", cwd=tmp_path)
    assert made.stderr == (
        "created keys; clients connect to tls/localhost:7447. To start a server, and to connect to it:\n"
    )
    start, connect = made.stdout.splitlines()
    assert start == "mjplug serve bundled:box --zenoh-config keys/server/server.json5"
    assert connect == "mjplug topic list --zenoh-config keys/operator.json5"
    server = Served(*start.split()[2:], cwd=tmp_path, listen=LISTEN)
    try:
        port = server.endpoint.rpartition(":")[2]
        listed = run(*connect.split()[1:], cwd=tmp_path, env={"MJPLUG_CONNECT": f"tls/localhost:{port}"})
        assert "/clock" in listed.stdout.splitlines(), listed.stderr
        # Moved as a whole, it works from there.
        (tmp_path / "elsewhere").mkdir()
        (tmp_path / "keys" / "operator.json5").rename(tmp_path / "elsewhere" / "mine.json5")
        listed = run("topic", "list", "--zenoh-config", "elsewhere/mine.json5", "-e", server.endpoint, cwd=tmp_path)
        assert "/clock" in listed.stdout.splitlines(), listed.stderr
    finally:
        server.kill()


def test_a_client_connects_to_the_endpoint_in_its_file(tmp_path):
    KeyFolder.create(tmp_path / "keys", ["localhost"], port=1)
    ran = run("topic", "list", "--zenoh-config", "keys/operator.json5", cwd=tmp_path)
    assert ran.returncode == 5
    assert "connection refused by tls/localhost:1: no mjplug server listens there;" in ran.stderr


def test_show_lists_the_certificates(tmp_path):
    keys = KeyFolder.create(tmp_path / "keys", ["localhost"])
    keys.add("eve", "viewer", days=-1.0)
    assert run("keys", "revoke", "operator", cwd=tmp_path).stdout == "operator is revoked\n"
    added = run("keys", "add", "alice", "--role", "viewer", "--days", "2", cwd=tmp_path)
    assert (added.stdout, "Restart the server" in added.stderr) == ("keys/alice.json5\n", True)
    shown = run("keys", "show", cwd=tmp_path).stdout
    date = r"20\d\d-\d\d-\d\d \d\d:\d\d UTC"
    for line in (
        f"worker +worker +{date} +valid", f"server +server +{date} +valid",
        f"operator +operator +{date} +revoked {date}", f"viewer +viewer +{date} +valid",
        f"eve +viewer +{date} +expired", f"alice +viewer +{date} +valid",
    ):  # fmt: skip
        assert re.search(f"^{line}$", shown, re.MULTILINE), (line, shown)
    told = json.loads(run("keys", "show", "--json", cwd=tmp_path).stdout)
    assert [(one["name"], one["state"].partition(" ")[0]) for one in told] == [
        ("worker", "valid"), ("server", "valid"), ("operator", "revoked"), ("viewer", "valid"), ("eve", "expired"),
        ("alice", "valid"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (
            ("show",),
            1,
            "error: keys contains no authority (keys.json is missing); make one with: mjplug keys init --out keys",
        ),
        (
            ("init", "--host", "tcp/1.2.3.4:7447"),
            1,
            "error: 'tcp/1.2.3.4:7447' is neither a host name nor an IP address",
        ),
        (("init", "--days", "1e9"), 2, "Invalid value for '--days'"),
        (("init", "--out", "/proc/keys"), 1, "error: cannot create /proc/keys: "),
        (("add", "x", "--role", "king"), 2, "'king' is unknown; roles are operator, viewer, worker, server"),
    ],
)
def test_failures_are_reported_in_one_sentence(tmp_path, words, code, sentence):
    ended = run("keys", *words, cwd=tmp_path)
    assert (ended.returncode, sentence in ended.stderr) == (code, True), ended.stderr


def test_without_the_library_the_error_contains_the_install_command(tmp_path):
    ended = run("keys", "init", cwd=tmp_path, command=WITHOUT_CRYPTOGRAPHY)
    assert ended.returncode == 1
    assert ended.stderr == (
        "error: the library `cryptography`, which creates certificates, is missing: pip install 'mjplug[security]'\n"
    )


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_doctor_finds_which_actions_are_allowed_to_which_client(tmp_path):
    KeyFolder.create(tmp_path / "keys", ["localhost"])
    server = Served("bundled:box", "--zenoh-config", "keys/server/server.json5", cwd=tmp_path, listen=LISTEN)
    unsafe = Served("bundled:box", cwd=tmp_path)
    try:
        for name in ("viewer", "operator"):
            words = ("--zenoh-config", f"keys/{name}.json5", "-e", server.endpoint, "--json")
            ran = run("doctor", "--security", *words, cwd=tmp_path, within=100.0)
            told = json.loads(ran.stdout)
            assert (ran.returncode, told["faults"]) == (0, 0)
            results = {(one["client"], one["action"]): one["result"] for one in told["attempts"]}
            me = f"{name}.json5"
            assert results["anonymous", "connect"] == "denied"
            assert results[me, "receive /clock"] == "allowed"
            assert results[me, "call /mjplug/get_parameters"] == "allowed"
            assert results[me, "call /mjplug/set_pause"] == ("allowed" if name == "operator" else "denied")
            assert results[me, "publish in place of /mjplug"] == "denied"
            assert results[me, "provide a service of /mjplug"] == "denied"
        ran = run("doctor", "--security", "-e", unsafe.endpoint, cwd=tmp_path, within=100.0)
        assert ran.returncode == 1
        for action in (
            "read the traffic on the network",
            "connect",
            "call /mjplug/reset_world",
            "publish in place of /mjplug",
        ):
            assert re.search(f"{action} +allowed +SHOULD BE DENIED", ran.stdout), (action, ran.stdout)
        state = run("sim", "state", "-e", unsafe.endpoint, cwd=tmp_path).stdout
        assert "running" in state
    finally:
        server.kill()
        unsafe.kill()


def test_doctor_reports_that_no_server_is_listening(tmp_path):
    ended = run("doctor", "--security", "-e", "tcp/127.0.0.1:1", cwd=tmp_path)
    assert (ended.returncode, "no program listens at tcp/127.0.0.1:1" in ended.stderr) == (5, True)
