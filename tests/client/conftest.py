"""A live server for the client to talk to."""

import pytest
from cli.process import Served

from mjplug.client import connect

SERVED = (
    "bundled:box", "--plugin", "external_wrench", "--plugin", "heartbeat",
    "--set", "plugins.heartbeat.update_rate=50", "--plugin", "base_velocity", "--set", "plugins.base_velocity.body=box",
    "--set", "remap={/base_velocity/cmd_vel: /cmd_vel}",
)  # fmt: skip


@pytest.fixture(scope="package")
def server(tmp_path_factory):
    served = Served(*SERVED, cwd=tmp_path_factory.mktemp("client"))
    yield served
    assert served.stop() == 0
    assert "Traceback" not in served.err.text


@pytest.fixture
def client(server):
    """A client of the shared server, which runs in real time again when the test is over."""
    with connect(server.endpoint) as client:
        yield client
        client.call("~/set_pause", paused=False)
        client.call("~/reset_world")
