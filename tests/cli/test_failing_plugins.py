"""Plugins that go wrong, and simulations that diverge: loudly, with the right exit code, under the right policy."""

import re

import pytest
from cli.conftest import WORLD


@pytest.fixture
def faulty(cli):
    def faulty(plugin, *arguments, duration="1"):
        return cli(
            "serve", "scene.xml", "--plugin", f"faulty:{plugin}:culprit", "--plugin", "heartbeat",
            "--speed", "max", "--duration", duration, "--listen", "tcp/127.0.0.1:0", *arguments, cwd=WORLD,
        )  # fmt: skip

    return faulty


def test_a_plugin_that_refuses_to_start_stops_the_server_with_its_reason(faulty):
    done = faulty("Refuses")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("error: plugin culprit refused to start: the moon is not full\n")
    assert "Traceback" not in done.stderr


def test_a_plugin_that_breaks_while_it_starts_shows_where(faulty):
    done = faulty("Breaks")
    assert (done.returncode, done.stdout) == (1, "")
    assert 'world/faulty.py", line ' in done.stderr
    assert done.stderr.endswith("error: plugin culprit failed to start: KeyError('nothing')\n")


def test_a_plugin_that_fails_while_it_runs_ends_the_server_with_a_traceback(faulty):
    done = faulty("Stumbles")
    assert done.returncode == 1
    assert done.stdout.startswith("ready")
    assert re.search(r"error: plugin culprit failed\n +Traceback", done.stderr)
    assert done.stderr.endswith(
        "error: plugin culprit failed: RuntimeError('tripped over a cable') (on_plugin_error: stop)\n"
    )


def test_a_plugin_that_fails_can_be_switched_off_while_the_rest_continues(serve, connect):
    server = serve(
        "scene.xml", "--plugin", "faulty:Stumbles:culprit", "--plugin", "heartbeat", "--paused",
        "--set", "on_plugin_error=disable", cwd=WORLD,
    )  # fmt: skip
    client = connect(server)
    assert client.do("culprit/ask") == "well"
    client.do("mjplug/step_simulation", steps=1000)
    assert client.ask("culprit/ask") == {
        "success": False,
        "message": "plugin culprit was disabled after an error: RuntimeError('tripped over a cable')",
    }
    beats = client.listen("mujoco_heartbeat/@json")
    client.do("mjplug/set_pause", paused=False)
    assert "Heartbeat #" in beats.next()["data"]
    assert server.stop() == 0
    assert server.err.text.count("Traceback") == 1


def test_a_service_that_fails_answers_with_an_error_and_the_server_runs_on(serve, connect):
    server = serve("scene.xml", "--plugin", "faulty:CannotServe:culprit", cwd=WORLD)
    client = connect(server)
    for _ in range(2):
        assert client.ask("culprit/ask") == {"success": False, "message": "internal error: RuntimeError('no idea')"}
    client.do("mjplug/set_pause", paused=True)
    # Its cleanup fails too.
    assert server.stop() == 0
    assert "RuntimeError: no idea" in server.err.text
    assert "RuntimeError: cannot let go" in server.err.text


DIVERGED = re.compile(
    r"the simulation diverged in step 51 \(t = 0\.100000 s\): "
    r"velocity of joint base_joint \(coordinate 0, body base_link\) is NaN, infinite or above 1e10"
)


def test_a_divergence_ends_the_server_where_that_is_the_policy(faulty):
    done = faulty("Diverges", "--set", "sim.on_divergence=stop")
    assert done.returncode == 1
    assert DIVERGED.search(done.stderr)
    assert done.stderr.endswith("the server stops (sim.on_divergence: stop)\n")
    assert "Traceback" not in done.stderr


def test_a_divergence_resets_the_world_where_that_is_the_policy(faulty):
    done = faulty("Diverges", "--set", "sim.on_divergence=reset", duration="0.35")
    assert done.returncode == 0
    assert len(DIVERGED.findall(done.stderr)) == 1
    assert done.stderr.count("the world is reset (sim.on_divergence: reset)") == 1
    assert "the simulation diverged 2 times more (consequence: reset); latest: " in done.stderr


def test_a_divergence_pauses_otherwise_and_a_reset_repairs_it(serve, connect):
    server = serve("scene.xml", "--plugin", "faulty:Diverges:culprit", "--plugin", "probe:Probe:probe", cwd=WORLD)
    client = connect(server)
    report = server.err.wait_for(DIVERGED.pattern)
    assert report.string.rstrip().endswith("paused before that step (sim.on_divergence: pause)")
    assert client.ask("mjplug/set_pause", paused=True)["message"] == "the simulation is already paused"
    client.do("mjplug/reset_world")
    assert '"qvel": [0.0, ' in client.do("probe/state")
    client.do("mjplug/step_simulation", steps=40)
    assert server.stop() == 0
