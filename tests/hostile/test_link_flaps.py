"""A network cable that is pulled and put back: services answer again, and subscriptions go on."""

import subprocess
import sys
import time
import uuid
from pathlib import Path

import pytest
from cli.process import COMMAND, Served, environment
from machine import has_network_namespaces, lacking

PROGRAM = Path(__file__).with_name("far_client.py")

BACK = 60.0
"""How long it may take on a busy machine until the client is served again [s]."""

LEASE_MS = 2000
"""After how long without a sign of life a link is given up; Zenoh's default is 10 s."""


def ip(*words):
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


class Cable:
    """Two machines, each in a network namespace, with a cable between them."""

    def __init__(self):
        mark = uuid.uuid4().hex[:6]
        self.near, self.far = f"mjplug-near-{mark}", f"mjplug-far-{mark}"

    def lay(self):
        for name in (self.near, self.far):
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        ip("link", "add", "eth0", "netns", self.near, "type", "veth", "peer", "name", "eth0", "netns", self.far)
        for name, address in ((self.near, "10.0.0.1/24"), (self.far, "10.0.0.2/24")):
            ip("-n", name, "address", "add", address, "dev", "eth0")
            ip("-n", name, "link", "set", "eth0", "up")

    def pull(self):
        ip("-n", self.near, "link", "set", "eth0", "down")

    def put_back(self):
        ip("-n", self.near, "link", "set", "eth0", "up")

    def spoil(self, *what):
        """Adds loss and delay, or skips the test where the kernel has no netem."""
        done = subprocess.run(
            ["ip", "netns", "exec", self.near, "tc", "qdisc", "add", "dev", "eth0", "root", "netem", *what],
            check=False, capture_output=True, text=True,
        )  # fmt: skip
        if done.returncode != 0:
            lacking(f"no netem on this machine: {done.stderr.strip()}")

    def remove(self):
        for name in (self.near, self.far):
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


@pytest.fixture
def cable():
    if not has_network_namespaces():
        lacking("this process may not make network namespaces")
    made = Cable()
    try:
        try:
            made.lay()
        except subprocess.CalledProcessError as error:
            lacking(f"no cable between network namespaces on this machine: {error.stderr.strip()}")
        yield made
    finally:
        made.remove()


class FarClient:
    """`far_client.py` on the far machine."""

    def __init__(self, cable, config):
        self._process = subprocess.Popen(
            ["ip", "netns", "exec", cable.far, sys.executable, str(PROGRAM), "tcp/10.0.0.1:7000", str(config)],
            env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        if self._process.stdout.readline() != "connected\n":
            self.kill()
            raise AssertionError("the far client did not connect")

    def ask(self, word):
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()
        return self._process.stdout.readline().strip()

    def ask_until(self, word, answer):
        until = time.monotonic() + BACK
        while (said := self.ask(word)) != answer:
            assert time.monotonic() < until, said

    def kill(self):
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def far(cable, tmp_path):
    """A server on the near machine, and a client on the far one."""
    config = tmp_path / "zenoh.json5"
    config.write_text(f"{{transport: {{link: {{tx: {{lease: {LEASE_MS}}}}}}}}}")
    server = Served(
        "bundled:box", "--set", f"zenoh.config={config}", cwd=tmp_path,
        command=("ip", "netns", "exec", cable.near, *COMMAND), listen=("--listen", "tcp/10.0.0.1:7000"),
    )  # fmt: skip
    client = None
    try:
        client = FarClient(cable, config)
        yield client
        assert server.stop() == 0
        assert "Traceback" not in server.err.text
        assert "accepts all clients" in server.err.text
    finally:
        if client is not None:
            client.kill()
        server.kill()


def flap(cable, far, downtime):
    cable.pull()
    time.sleep(downtime)
    cable.put_back()
    far.ask_until("call", "the simulation is already running")
    far.ask_until("clock", "clock")


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_remote_client_survives_ten_flaps_of_its_link(cable, far):
    # Shorter and longer than the lease: TCP recovers from the first, Zenoh reconnects after the second.
    for downtime in (0.5, 3.0) * 5:
        flap(cable, far, downtime)


@pytest.mark.slow
def test_a_remote_client_survives_loss_and_delay(cable, far):
    cable.spoil("delay", "50ms", "20ms", "loss", "5%")
    for _ in range(10):
        far.ask_until("call", "the simulation is already running")
        far.ask_until("clock", "clock")
