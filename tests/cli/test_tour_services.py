"""A tour of `mjplug service` and `mjplug sim`: every command against a live server, with text and exit codes."""

import json
import re
import time

import pytest
import yaml
from cli.process import STARTING, Served

from mjplug.client import connect
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause
from mjplug_schemas.rihs01 import type_hash

PUSH = (
    "{wrenches: {external_wrenches: "
    "[{wrench: {header: {frame_id: box}, wrench: {force: {x: 1}}}, duration: {sec: 1}}]}}"
)


def test_services_are_listed_and_described(tour):
    listed = tour.ask("service", "list").splitlines()
    assert listed == sorted(listed)
    assert {"/external_wrench/apply_wrench", "/mjplug/set_pause"} <= {*listed}
    assert f"/mjplug/set_pause [{SetPause.TYPE}]" in tour.ask("service", "list", "-t").splitlines()
    assert tour.ask("service", "list", "-c") == f"{len(listed)}\n"
    assert [service["name"] for service in json.loads(tour.ask("service", "list", "--json"))] == listed
    assert tour.ask("service", "type", "~/set_pause") == f"{SetPause.TYPE}\n"
    assert tour.ask("service", "find", "mujoco_ros2_control_msgs/SetPause") == "/mjplug/set_pause\n"
    assert tour.ask("service", "info", "/mjplug/set_pause").splitlines() == [
        f"Type: {SetPause.TYPE}",
        "Server: /mjplug",
        "Key: mjplug/set_pause",
        f"Type hash: {type_hash(SetPause)}",
    ]


def test_a_service_is_called_with_and_without_its_type_and_values(tour):
    paused = tour.ask("service", "call", "~/set_pause", "{paused: true}")
    assert paused == "success: true\nmessage: the simulation is now paused\n"
    already = tour.ask("service", "call", "/mjplug/set_pause", SetPause.TYPE, "{paused: yes}", "-o", "json")
    assert json.loads(already) == {"success": True, "message": "the simulation is already paused"}
    # Initial values: not paused.
    resumed = tour.ask("service", "call", "~/set_pause", "mujoco_ros2_control_msgs/SetPause")
    assert yaml.safe_load(resumed)["message"] == "the simulation is now running"
    assert "already running" in tour.ask("service", "call", "~/set_pause", "{paused: false}", "--timeout", "inf")


def test_a_wrench_is_waited_for(tour):
    assert "applied 1 wrench, the longest for 1 s" in tour.ask("service", "call", "/external_wrench/apply_wrench", PUSH)


def test_an_unsuccessful_response_ends_with_7_and_is_shown(tour):
    done = tour.type("service", "call", "~/step_simulation", "{steps: 3}")
    assert done.code == 7
    assert yaml.safe_load(done.out) == {
        "success": False,
        "message": "the simulation is running; pause it first (~/set_pause, or mjplug sim pause)",
    }
    # The response above has the reason.
    assert done.err == "error: /mjplug/step_simulation refused the request\n"


@pytest.mark.parametrize(
    ("code", "words", "sentence"),
    [
        (1, ("call", "/set_pause"), r"unknown service '/set_pause', did you mean '/mjplug/set_pause'\?"),
        (1, ("type", "~/set_paus"), r"unknown service '/mjplug/set_paus', did you mean"),
        (2, ("call", "~/set_pause", "std_srvs/srv/Trigger"), r"is mujoco_ros2_control_msgs/srv/SetPause, not std_srvs"),
        (2, ("call", "~/set_pause", "{pausd: true}"), r"unknown field 'pausd', did you mean 'paused'\?; known: paused"),
        (2, ("call", "~/set_pause", "{paused: 1}"), r"paused must be a bool \(true or false\), got 1"),
        (2, ("call", "~/set_pause", "[true]"), r"'\[true\]' contains no fields"),
        (2, ("find", "mujoco_ros2_control_msgs/SetPaus"), r"unknown type .*did you mean '\S+/srv/SetPause'\?"),
        (2, ("call", "~/set_pause", "--timeout", "-1"), r"Invalid value for '--timeout'"),
        (2, ("call",), r"Missing argument 'SERVICE'"),
    ],
)  # fmt: skip
def test_errors_are_reported_in_one_sentence(tour, code, words, sentence):
    assert re.search(sentence, tour.fail(code, "service", *words))


def test_an_answer_that_does_not_come_is_exit_code_6(tour):
    tour.ask("sim", "pause")
    said = tour.fail(6, "service", "call", "/external_wrench/apply_wrench", PUSH, "--timeout", "0.3")
    assert said == "error: no answer from /external_wrench/apply_wrench within 0.3 s; the simulation is paused\n"


def fields(text):
    return dict(re.findall(r"^(\w+): +(.*)$", text, re.MULTILINE))


def test_the_state_of_the_simulation_is_shown(tour):
    state = fields(tour.ask("sim", "state"))
    assert state["server"].startswith(f"/mjplug at {tour.endpoint}, mjplug ")
    assert (state["model"], state["state"]) == ("tour.xml", "running")
    assert re.fullmatch(r"1 \(measured: [\d.]+\)", state["speed"])
    told = json.loads(tour.ask("sim", "state", "-o", "json"))
    assert told["measured_speed"] == pytest.approx(1.0, rel=0.5)
    assert told["time"] > float(state["time"].removesuffix(" s"))
    tour.ask("sim", "reset")
    assert json.loads(tour.ask("sim", "state", "-o", "json"))["resets"] == told["resets"] + 1


def test_of_several_servers_each_shows_its_own_time(tour, tmp_path):
    other = Served("bundled:box", "--speed", "0.01", "--set", "namespace=other", "-e", tour.endpoint, cwd=tmp_path)
    try:
        with connect(tour.endpoint) as client:
            client.wait_for("/other/mjplug/get_diagnostics")
        assert "there are several servers: /mjplug, /other/mjplug; choose one" in tour.fail(1, "sim", "state")
        own, others = (
            json.loads(tour.ask("sim", "state", "--server", name, "-o", "json")) for name in ("/mjplug", "other/mjplug")
        )
        assert others["server"] == "/other/mjplug"
        # At a hundredth of the speed it is not a second old, and the tour is on its way for longer.
        assert others["time"] < 1.0
        assert others["measured_speed"] < 0.1 < own["measured_speed"]
        assert "several servers publish /clock: /mjplug, /other/mjplug" in tour.fail(1, "topic", "delay", "/clock")
    finally:
        assert other.stop() == 0


def test_a_simulation_is_paused_stepped_and_resumed(tour):
    assert tour.ask("sim", "pause") == "the simulation is now paused\n"
    before = json.loads(tour.ask("sim", "state", "-o", "json"))
    assert (before["state"], before["measured_speed"]) == ("paused", None)
    assert tour.ask("sim", "step").startswith("took 1 step")
    assert tour.ask("sim", "step", "249").startswith("took 249 steps; t = ")
    after = json.loads(tour.ask("sim", "state", "-o", "json"))
    assert after["time"] - before["time"] == pytest.approx(0.25)
    assert tour.ask("sim", "resume") == "the simulation is now running\n"
    assert "pause it first" in tour.fail(7, "sim", "step")
    assert "Invalid value for 'STEPS'" in tour.fail(2, "sim", "step", "0")


def test_a_world_is_reset(tour):
    assert tour.ask("sim", "reset") == "the world was reset to its initial state\n"
    assert tour.ask("sim", "reset", "--keyframe", "lifted") == "the world was reset to keyframe 'lifted'\n"
    said = tour.fail(7, "sim", "reset", "-k", "lift")
    assert said.startswith("error: /mjplug/reset_world refused: unknown keyframe 'lift', did you mean 'lifted'?")


def measure(tour, enough):
    """Measures the speed until it is as wanted: for a moment, other programs may have the processor."""
    until = time.monotonic() + STARTING
    while not enough(speed := json.loads(tour.ask("sim", "state", "-o", "json"))["measured_speed"]):
        assert time.monotonic() < until, speed


def test_the_speed_is_shown_and_changed(tour):
    assert tour.ask("sim", "speed") == "1\n"
    assert tour.ask("sim", "speed", "0.1") == "0.1\n"
    measure(tour, lambda speed: 0.0 < speed < 0.2)
    assert tour.ask("sim", "speed", "4") == "4\n"
    measure(tour, lambda speed: 1.5 < speed < 5.0)
    assert tour.ask("sim", "speed", "max") == "max\n"
    measure(tour, lambda speed: speed > 1.5)
    assert "from 0.001 to 1000, or 'max', not -1.0" in tour.fail(7, "sim", "speed", "-1")
    assert "'fast' is neither a number nor max" in tour.fail(2, "sim", "speed", "fast")
    assert "'sim.speed': it must be a number from 0.001 to 1000, or 'max', not 0.0" in tour.fail(7, "sim", "speed", "0")
    assert tour.ask("sim", "speed") == "max\n"
