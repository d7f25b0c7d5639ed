"""A tour of `mjplug node` and `mjplug param`, against a live server."""

import pytest
import yaml

from mjplug.client import connect


def test_servers_are_listed_as_nodes(tour):
    assert tour.ask("node", "list") == "/mjplug\n"
    assert tour.ask("node", "list", "--count-nodes") == "1\n"


@pytest.mark.parametrize("name", ["/mjplug", "mjplug", "~"])
def test_a_node_is_described_in_the_form_of_ros2(tour, name):
    lines = tour.ask("node", "info", name).splitlines()
    headings = [line for line in lines if not line.startswith("    ")]
    assert headings == [
        "/mjplug", "  Subscribers:", "  Publishers:", "  Service Servers:", "  Service Clients:", "  Action Servers:",
        "  Action Clients:",
    ]  # fmt: skip
    subscribers = lines[lines.index("  Subscribers:") + 1 : lines.index("  Publishers:")]
    publishers = lines[lines.index("  Publishers:") + 1 : lines.index("  Service Servers:")]
    services = lines[lines.index("  Service Servers:") + 1 : lines.index("  Service Clients:")]
    assert "    /cmd_vel: geometry_msgs/msg/Twist" in subscribers
    assert "    /clock: rosgraph_msgs/msg/Clock" in publishers
    assert "    /mjplug/set_pause: mujoco_ros2_control_msgs/srv/SetPause" in services
    assert services == sorted(services)


def test_a_node_that_is_not_there_is_a_sentence(tour):
    assert "unknown node '/mjplu', did you mean '/mjplug'?" in tour.fail(1, "node", "info", "mjplu")
    assert "unknown node '/other'" in tour.fail(1, "param", "list", "/other")


def test_parameters_are_listed(tour):
    everything = tour.ask("param", "list").splitlines()
    assert everything[0] == "/mjplug:"
    assert "  sim.speed" in everything
    assert tour.ask("param", "list", "~").splitlines() == everything[1:]
    chosen = tour.ask("param", "list", "~", "--filter", "sim[.]s", "--param-type").splitlines()
    assert "  sim.speed (type: double)" in chosen
    assert "  sim.seed (type: integer)" in chosen
    assert all(line.startswith("  sim.s") for line in chosen)
    below = tour.ask("param", "list", "~", "--param-prefixes", "sim").splitlines()
    assert below == [line for line in everything if line.startswith("  sim.")]
    assert "'[' is not a regular expression" in tour.fail(2, "param", "list", "--filter", "[")


@pytest.mark.parametrize(
    ("name", "shown", "value"),
    [
        ("sim.speed", "Double value is: 1.0", "1.0"),
        ("sim.seed", "Integer value is: 0", "0"),
        ("use_sim_time", "Boolean value is: True", "True"),
        ("model", "String value is: tour.xml", "tour.xml"),
    ],
)
def test_a_parameter_is_shown_in_the_form_of_ros2(tour, name, shown, value):
    assert tour.ask("param", "get", "/mjplug", name) == f"{shown}\n"
    assert tour.ask("param", "get", "~", name, "--hide-type") == f"{value}\n"


def test_a_parameter_is_set(tour):
    # An integer, where the parameter is a double.
    shown = {"2": "Double value is: 2.0", "0.5": "Double value is: 0.5", "max": "String value is: max"}
    for value, seen in shown.items():
        assert tour.ask("param", "set", "~", "sim.speed", value) == "Set parameter successful\n"
        assert tour.ask("param", "get", "~", "sim.speed") == f"{seen}\n"


@pytest.mark.parametrize(
    ("code", "words", "sentence"),
    [
        (1, ("get", "~", "sim.sped"), "unknown parameter 'sim.sped', did you mean 'sim.speed'?; there are: model, "),
        (1, ("describe", "~", "sim.sped"), "unknown parameter 'sim.sped', did you mean 'sim.speed'?"),
        (7, ("set", "~", "sim.sped", "1"), "unknown parameter 'sim.sped', did you mean 'sim.speed'?"),
        (7, ("set", "~", "sim.speed", "-1"), "it must be a number from 0.001 to 1000, or 'max', not -1.0"),
        (7, ("set", "~", "model", "other.xml"), "it is read-only"),
        (2, ("set", "~", "model", "{a: 1}"), "'{a: 1}' is not the value of a parameter"),
        (2, ("set", "~", "model", "[1, a]"), "is not a bool, a number, a string, or a list of values of one type"),
    ],
)
def test_what_is_wrong_with_a_parameter_is_a_sentence(tour, code, words, sentence):
    assert sentence in tour.fail(code, "param", *words)


def test_a_parameter_is_described_in_the_form_of_ros2(tour):
    lines = tour.ask("param", "describe", "~", "sim.seed", "sim.speed").splitlines()
    assert lines[:2] == ["Parameter name: sim.seed", "  Type: integer"]
    assert lines[2].startswith("  Description: ")
    assert lines[3:5] == ["  Constraints:", "    Read only: true"]
    assert lines[5:7] == ["Parameter name: sim.speed", "  Type: double"]
    assert lines[-1] == "  Constraints:"


def test_what_is_dumped_can_be_loaded_again(tour, tmp_path):
    tour.ask("sim", "speed", "0.5")
    dumped = tour.ask("param", "dump", "/mjplug")
    tree = yaml.safe_load(dumped)
    assert list(tree) == ["/mjplug"]
    parameters = tree["/mjplug"]["ros__parameters"]
    assert (parameters["sim"]["speed"], parameters["model"], parameters["use_sim_time"]) == (0.5, "tour.xml", True)
    file = tmp_path / "dumped.yaml"
    file.write_text(dumped)
    tour.ask("sim", "speed", "1")
    loaded = tour.ask("param", "load", "~", str(file)).splitlines()
    assert "Set parameter sim.speed successful" in loaded
    assert tour.ask("param", "get", "~", "sim.speed", "--hide-type") == "0.5\n"


def test_a_file_for_several_nodes_is_read_as_rcl_does(tour, tmp_path):
    file = tmp_path / "several.yaml"
    file.write_text(
        "/**:\n  ros__parameters: {sim: {speed: 0.5}}\n"
        "mjplug:\n  ros__parameters: {sim.speed: 2}\n"
        "/other:\n  ros__parameters: {sim.speed: 9}\n"
    )
    tour.ask("param", "load", "~", str(file))
    assert tour.ask("param", "get", "~", "sim.speed", "--hide-type") == "2.0\n"
    file.write_text("/**:\n  ros__parameters: {sim: {speed: 0.5}}\n")
    assert "contains no parameters for /mjplug, only for: /**" in tour.fail(
        1, "param", "load", "~", str(file), "--no-use-wildcard"
    )
    file.write_text("/mjplug:\n  ros__parameters: {sim: {speed: 0.5, seed: 7}}\n")
    done = tour.type("param", "load", "~", str(file))
    assert (done.code, done.out) == (7, "Set parameter sim.speed successful\n")
    assert "Set parameter sim.seed failed: parameter 'sim.seed': it is read-only" in done.err
    assert "no such file" in tour.fail(3, "param", "load", "~", str(tmp_path / "none.yaml"))


def test_steps_that_take_longer_than_the_timeout_are_not_called_a_pause(tour):
    tour.ask("sim", "pause")
    said = tour.fail(6, "sim", "step", "100000000", "--timeout", "0.2")
    assert said == (
        "error: no answer from /mjplug/step_simulation within 0.2 s; the server still takes the steps, "
        "until `mjplug sim pause` or ~/set_pause cancels them\n"
    )
    with connect(tour.endpoint) as client:
        assert client.call("~/set_pause", paused=True).success
        assert client.call("~/step_simulation", steps=1).message.startswith("took 1 step")
