"""A server on one machine and clients on another: two network namespaces, joined by a virtual cable."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from camera_scenes import (
    FLOOR,
    gl,  # noqa: F401 - a fixture
    scene,
)
from cli.process import COMMAND, Served, environment
from machine import lacking

from mjplug.security.folder import KeyFolder

HOST = "10.98.0.1"
TESTS = Path(__file__).parent.parent

ROBOT = """
<body name="arm" pos="1 0 1"><joint name="elbow" axis="0 1 0" damping="1"/><geom size=".1"/></body>
<body name="ball" pos="0 0 3"><freejoint/><geom size=".1"/></body>
"""
EYE = '<camera name="eye" pos="0 0 2" resolution="64 48"/>'

CONFIG = """
model: scene.xml
plugins:
  cameras: {type: camera, camera_publish_rate: 10.0, sync: true}
  joint_commands: {type: joint_commands}
  push: {type: external_wrench}
"""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]


def ip(*words, check=True):
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=check)


@pytest.fixture(scope="module")
def namespaces():
    simulator, laptop = (f"mjplug-{name}-{os.getpid()}" for name in ("simulator", "laptop"))
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("ip") is None:
        lacking("network namespaces need Linux, root and `ip` (Debian: apt-get install iproute2)")
    if (tried := ip("netns", "add", simulator, check=False)).returncode != 0:
        lacking(f"this machine lets nobody make network namespaces: {tried.stderr.strip()}")
    try:
        ip("netns", "add", laptop)
        ip("link", "add", "eth0", "netns", simulator, "type", "veth", "peer", "name", "eth0", "netns", laptop)
        for namespace, address in ((simulator, HOST), (laptop, "10.98.0.2")):
            ip("-n", namespace, "address", "add", f"{address}/24", "dev", "eth0")
            for link in ("lo", "eth0"):
                ip("-n", namespace, "link", "set", link, "up")
        yield simulator, laptop
    finally:
        # The cable goes with its ends.
        for namespace in (simulator, laptop):
            ip("netns", "del", namespace, check=False)


def inside(namespace, *words, cwd):
    """Runs a program in a namespace to its end."""
    return subprocess.run(
        ["ip", "netns", "exec", namespace, *words],
        cwd=cwd,
        env=environment({"PYTHONPATH": str(TESTS)}),
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


@pytest.fixture(scope="module")
def lab(namespaces, gl, tmp_path_factory):  # noqa: F811
    """A server of `keys init`, in the simulator's namespace."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "scene.xml").write_text(scene(EYE, FLOOR + ROBOT))
    (folder / "config.yaml").write_text(CONFIG)
    made = inside(namespaces[0], *COMMAND, "keys", "init", "--host", HOST, cwd=folder)
    assert made.returncode == 0, made.stderr
    serve, _ = made.stdout.splitlines()
    words = serve.replace("bundled:box", "config.yaml").split()[2:]
    keys = KeyFolder(folder / "keys")
    keys.add("eve", "operator", days=-1.0)
    bob = keys.add("bob", "operator")
    kept = bob.read_text()
    keys.revoke("bob")
    bob.write_text(kept)
    (folder / "nobody.json5").write_text(
        '{mode: "client", transport: {link: {tls: {root_ca_certificate: "keys/ca.pem"}}}}'
    )
    server = Served(*words, cwd=folder, command=("ip", "netns", "exec", namespaces[0], *COMMAND), listen=())
    yield Lab(folder, namespaces, server)
    assert server.stop() == 0
    assert "Traceback" not in server.err.text


class Lab:
    def __init__(self, folder, namespaces, server):
        self.folder, self.server = folder, server
        self.simulator, self.laptop = namespaces

    def probe(self, name, *what):
        """Runs the probe on the laptop with the certificate of a user."""
        file = f"keys/{name}.json5" if name != "nobody" else "nobody.json5"
        words = (sys.executable, "-m", "security.probe", file, f"tls/{HOST}:7447", *what)
        ran = inside(self.laptop, *words, cwd=self.folder)
        assert ran.returncode == 0, ran.stderr
        return json.loads(ran.stdout)

    def command(self, name, *words, where=None):
        """Runs `mjplug` on the laptop, as somebody; the file knows where the server is."""
        file = f"keys/{name}.json5" if name != "nobody" else "nobody.json5"
        return inside(where or self.laptop, *COMMAND, *words, "--zenoh-config", file, cwd=self.folder)

    def state(self):
        """What a command would change."""
        ran = self.command("operator", "service", "call", "~/get_diagnostics", "-o", "json", where=self.simulator)
        assert ran.returncode == 0, ran.stderr
        statuses = {one["name"]: one["values"] for one in json.loads(json.loads(ran.stdout)["message"])["status"]}
        values = {(name, value["key"]): value["value"] for name, told in statuses.items() for value in told}
        return {key: values[key] for key in STATE}


STATE = (
    ("mjplug: simulation", "state"),
    ("mjplug: simulation", "wanted speed"),
    ("mjplug: simulation", "steps"),
    ("mjplug: simulation", "resets"),
    ("mjplug: joint_commands", "messages accepted"),
    ("mjplug: joint_commands", "messages refused"),
    ("mjplug: wire", "refused"),
)

READ_ONLY = {
    f"/mjplug/{name}"
    for name in (
        "describe_parameters", "get_parameters", "get_parameter_types", "list_parameters", "get_diagnostics",
        "list_states", "get_state_digest",
    )
}  # fmt: skip


def test_a_viewer_on_another_machine_sees_everything_and_changes_nothing_while_an_operator_may(lab):
    heard = lab.probe("viewer", "look", "clock", "cameras/eye/color", "cameras/eye/camera_info")
    assert heard["clock"] == 4 + 8
    assert heard["cameras/eye/color"] > 64 * 48 * 3
    paused = lab.command("operator", "sim", "pause")
    assert paused.stdout == "the simulation is now paused\n", paused.stderr
    before = lab.state()
    tried = lab.probe("viewer", "attack")
    # On its plain key in CDR and in JSON, and on its ROS 2 key.
    assert tried["answered"] == {name: 3 * (name in READ_ONLY) for name in tried["answered"]}
    assert {*tried["topics"].values()} == {"published", "subscribed"}
    assert len(tried["answered"]) == 12
    assert lab.state() == before
    tried = lab.probe("operator", "attack")
    assert {*tried["answered"].values()} == {3}
    after = lab.state()
    assert after["mjplug: simulation", "state"] == "running"
    assert after["mjplug: simulation", "resets"] == "3"
    assert after["mjplug: joint_commands", "messages accepted"] != "0"


@pytest.mark.parametrize("name", ["nobody", "bob", "eve"])
def test_without_a_valid_certificate_nothing_comes_in(lab, name):
    assert lab.probe(name, "knock") == {"connected": False, "bytes": 0}


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nobody", "requires a client certificate"),
        ("bob", "refuses the certificate in keys/bob.json5: it was revoked"),
        ("eve", "the certificate in keys/eve.json5 expired on 20"),
    ],
)
def test_the_command_line_says_why_it_is_not_let_in(lab, name, sentence):
    ran = lab.command(name, "topic", "list", "-e", f"tls/{HOST}:7447")
    assert ran.returncode == 5
    assert sentence in ran.stderr
    assert ran.stderr.count("\n") == 1
