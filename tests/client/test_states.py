"""Saved states of a live server."""

import json
import signal

import pytest
from cli.process import Served, run

from mjplug.client import RequestRefused, connect

SERVED = (
    "bundled:quadruped", "--paused", "--plugin", "external_wrench", "--plugin", "joint_commands", "--plugin", "sensors",
    "--plugin", "joint_state_publisher", "--set", "snapshots.folder=states", "--set", "plugins.sensors.noise=true",
)  # fmt: skip
PUSH = {
    "wrenches": {
        "external_wrenches": [
            {
                "wrench": {"header": {"frame_id": "base_link"}, "wrench": {"force": {"x": 40.0, "z": 5.0}}},
                "duration": {"sec": 1},
                "ramp_down_duration": {"nanosec": 900_000_000},
            }
        ]
    }
}


def test_a_state_is_restored(client):
    client.call("~/set_pause", paused=True)
    client.call("~/step_simulation", steps=10)
    saved = client.save("a", overwrite=True)
    client.call("~/step_simulation", steps=500)
    later = client.call("~/get_state_digest")
    epoch = client.subscribe("~/epoch")
    before = epoch.next(timeout=10.0).data
    restored = client.restore("a", strict=True)
    assert (restored.step, restored.digest) == (saved.step, saved.digest)
    assert epoch.next(timeout=10.0).data == before + 1
    client.call("~/step_simulation", steps=500)
    again = client.call("~/get_state_digest")
    assert (again.step, again.digest) == (later.step, later.digest)
    assert (again.epoch, again.model_digest) == (before + 1, saved.model_digest)
    assert [one.name for one in client.call("~/list_states").snapshots] == ["a"]
    kept = client.restore("a", keep_time=True)
    assert kept.digest == saved.digest
    assert client.call("~/get_state_digest").step == later.step
    client.call("~/delete_state", {"name": "a"})


def test_a_state_that_is_not_there_is_refused(client):
    with pytest.raises(RequestRefused, match="unknown state 'nothing'; there is no state"):
        client.restore("nothing")
    with pytest.raises(RequestRefused, match=r"set snapshots\.folder in the configuration"):
        client.save("a", file=True)
    with pytest.raises(RequestRefused, match="cannot be the name of a state"):
        client.save("../a")


@pytest.mark.slow
def test_a_simulation_continues_after_its_server_was_killed(tmp_path):
    def follow(client):
        topics = [name for name in client.topics() if name == "/joint_states" or name.startswith("/sensors/")]
        assert len(topics) > 1
        subscriptions = [client.subscribe(name, bytes, depth=1000) for name in topics]
        client.call("~/step_simulation", steps=1000)
        digest = client.call("~/get_state_digest").digest
        return digest, [[one.next(timeout=10.0) for _ in range(150)] for one in subscriptions]

    first = Served(*SERVED, cwd=tmp_path)
    with connect(first.endpoint) as client:
        client.call("~/step_simulation", steps=203)
        client.session.get("external_wrench/apply_wrench?wait=false", payload=json.dumps(PUSH).encode())
        client.call("~/step_simulation", steps=100)
        saved = client.save("walk", file=True)
        assert saved.left_out == ()
        expected = follow(client)
    first.process.send_signal(signal.SIGKILL)
    first.process.wait(10.0)
    second = Served(*SERVED, cwd=tmp_path)
    with connect(second.endpoint) as client:
        assert client.restore("walk", file=True, strict=True).left_out == ()
        assert follow(client) == expected
        shown = run("sim", "states", "-o", "json", "--connect", second.endpoint, cwd=tmp_path)
        assert f'"digest": "{saved.digest}"' in shown.stdout
    assert second.stop() == 0
