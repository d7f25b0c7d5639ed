"""The commands that need no server: `interface`, `model`, `config`, `plugin`, `completion`."""

import json
import re

import mujoco
import numpy as np
import pytest
import yaml
from cli.tour import typed

from mjplug.config.settings import PluginEntry
from mjplug.model.location import bundled_models
from mjplug.plugin import registry
from mjplug_schemas.registry import all_types, find
from mjplug_schemas.rihs01 import type_hash

ROS_FILE = """\
/**:
  ros__parameters:
    mujoco_plugins:
      beat: {type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin, update_rate: 2.0, topic: "1e3"}
      push: {type: mujoco_ros2_control_plugins/ExternalWrenchPlugin}
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("MJPLUG_CONNECT", "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("COLUMNS", "200")
    return tmp_path


@pytest.fixture
def ask(here):
    """Runs a command that must succeed, and returns what it printed."""

    def ask(*words):
        done = typed(*words)
        assert done.code == 0, done
        return done.out

    return ask


@pytest.fixture
def fail(here):
    """Runs a command that must fail with a code, and returns what it complained about."""

    def fail(code, *words):
        done = typed(*words)
        assert done.code == code, done
        return done.err

    return fail


def test_types_are_listed_shown_and_hashed(ask):
    assert ask("interface", "list").splitlines() == list(all_types())
    assert "std_srvs/srv/Trigger" in ask("interface", "list", "-s").splitlines()
    assert all("/msg/" in name for name in ask("interface", "list", "--only-msgs").splitlines())
    assert ask("interface", "show", "geometry_msgs/Twist").endswith(
        "geometry_msgs/Vector3 angular\n\tfloat64 x\n\tfloat64 y\n\tfloat64 z\n"
    )
    assert "\n---\n" in ask("interface", "show", "std_srvs/srv/Trigger")
    assert ask("interface", "hash", "std_srvs/Trigger") == f"{type_hash(find('std_srvs/srv/Trigger'))}\n"


def test_an_unknown_type_is_a_usage_error_with_a_guess(fail):
    assert "did you mean 'geometry_msgs/msg/Twist'?" in fail(2, "interface", "show", "geometry_msgs/msg/Twits")


@pytest.mark.parametrize("name", bundled_models())
def test_a_model_is_described_as_mujoco_has_it(ask, name):
    told = json.loads(ask("model", "info", f"bundled:{name}", "-o", "json"))
    model = mujoco.MjModel.from_xml_path(told["path"])
    assert (told["nq"], told["nv"], told["nu"]) == (model.nq, model.nv, model.nu)
    assert told["mass"] == pytest.approx(model.body_mass.sum())
    assert [body["name"] for body in told["bodies"]] == [model.body(i).name for i in range(1, model.nbody)]
    assert [len(told[kind]) for kind in ("joints", "actuators", "sensors", "sites", "cameras", "keyframes")] == [
        model.njnt, model.nu, model.nsensor, model.nsite, model.ncam, model.nkey,
    ]  # fmt: skip
    for joint in told["joints"]:
        there = model.joint(joint["name"])
        assert (joint["qpos"], joint["qvel"]) == (there.qposadr[0], there.dofadr[0])
        assert joint["range"] == "-" or np.allclose(joint["range"], there.range)


def test_the_tables_of_a_model_are_readable(ask):
    text = ask("model", "info", "bundled:arm")
    assert re.search(r"^timestep: +0\.002$", text, re.MULTILINE)
    assert re.search(r"^  joint1 +hinge +link1 +-2\.8 2\.8 +0 +0$", text, re.MULTILINE)
    assert re.search(r"^  gripper_left_finger_joint +tendon +gripper +-0\.045 0\.005 +1$", text, re.MULTILINE)
    assert (
        ask("model", "info", "bundled:arm", "keyframes")
        == "keyframes\n  name      index  time\n  home      0      0\n  start_90  1      0\n"
    )
    assert ask("model", "info", "bundled:arm", "counts").startswith("arm (")


def test_a_wrong_model_or_table_is_reported(fail):
    assert "did you mean 'joints'?; known: counts, bodies" in fail(2, "model", "info", "bundled:arm", "jonts")
    assert "bundled" in fail(4, "model", "info", "bundled:arms")


@pytest.mark.parametrize("name", bundled_models())
def test_a_starting_file_is_valid_as_it_is_and_with_every_comment_taken_out(ask, here, name):
    ask("config", "init", f"bundled:{name}", "-o", "start.yaml")
    text = (here / "start.yaml").read_text()
    (here / "all.yaml").write_text(re.sub(r"^# (?=[\w#]+:|  )", "", text, flags=re.MULTILINE))
    assert len(yaml.safe_load((here / "all.yaml").read_text())) > len(yaml.safe_load(text))
    assert ask("config", "check", "all.yaml") == ask("config", "check", "start.yaml")
    assert ask("config", "init", f"bundled:{name}") == text


def test_files_are_not_written_over(ask, fail, here):
    ask("config", "init", "bundled:box", "-o", "start.yaml")
    assert fail(1, "config", "init", "bundled:box", "-o", "start.yaml").startswith("error: start.yaml already exists")
    assert fail(1, "config", "schema", "-o", "no/such/folder.json").startswith(
        "error: cannot write no/such/folder.json"
    )


def test_the_configuration_in_effect_is_shown_with_the_origin_of_each_value(ask, here, monkeypatch):
    (here / "robot.yaml").write_text("model: bundled:box\nplugins:\n  beat: {type: heartbeat, update_rate: 2}\n")
    monkeypatch.setenv("MJPLUG_SIM__SEED", "7")
    shown = ask("config", "show", "robot.yaml", "--set", "sim.speed=max")
    origins = {line.split(":")[0].strip(): line.partition("# ")[2] for line in shown.splitlines()}
    assert origins["model"] == "robot.yaml:1"
    assert origins["update_rate"] == "robot.yaml:3"
    assert origins["seed"] == "environment MJPLUG_SIM__SEED"
    assert origins["speed"] == "--set sim.speed=max"
    assert origins["topic"] == origins["clock_rate"] == "default"
    (here / "again.yaml").write_text(shown)
    monkeypatch.delenv("MJPLUG_SIM__SEED")
    again = ask("config", "show", "again.yaml")
    assert [line.partition("#")[0] for line in again.splitlines()] == [
        line.partition("#")[0] for line in shown.splitlines()
    ]


def test_a_wrong_configuration_is_exit_code_3(fail, here):
    (here / "wrong.yaml").write_text("model: bundled:box\nsim: {sped: 2}\n")
    for command in ("check", "show", "convert"):
        assert "wrong.yaml:2:7: error: sim.sped: unknown key" in fail(3, "config", command, "wrong.yaml")
    assert fail(3, "config", "check", "nowhere.yaml") == "nowhere.yaml: error: no such file\n"


def test_a_ros_parameter_file_becomes_a_configuration_that_means_the_same(ask, fail, here):
    (here / "ros.yaml").write_text(ROS_FILE)
    ask("config", "convert", "ros.yaml", "--model", "bundled:box", "-o", "own.yaml")
    assert (here / "own.yaml").read_text().startswith("model: bundled:box\nplugins:\n  beat:\n    type: mujoco_ros2")
    shown = [ask("config", "show", "own.yaml"), ask("config", "show", "ros.yaml", "--model", "bundled:box")]
    own, ros = ([line.partition("#")[0] for line in text.splitlines()] for text in shown)
    assert own == ros
    assert '    topic: "1e3"' in [line.rstrip() for line in own]
    assert "a ROS parameter file contains no model; give --model FILE" in fail(3, "config", "convert", "ros.yaml")


def resolve(schema, root):
    while "$ref" in schema:
        schema = root["$defs"][schema["$ref"].removeprefix("#/$defs/")]
    return schema


def references(schema):
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"]
        for part in schema.values():
            yield from references(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from references(part)


def test_the_schema_knows_every_setting_and_the_parameters_of_every_plugin(ask):
    schema = json.loads(ask("config", "schema"))
    own = schema["then"]
    assert own["additionalProperties"] is False
    assert {"model", "sim", "zenoh", "plugins"} <= set(own["properties"])
    sim, nothing = own["properties"]["sim"]["anyOf"]
    assert nothing == {"type": "null"}
    speed = resolve(sim, schema)["properties"]["speed"]
    assert {"const": "max", "type": "string"} in speed["anyOf"]
    assert {reference.removeprefix("#/$defs/") for reference in references(schema)} <= set(schema["$defs"])
    entry = schema["$defs"]["PluginEntry"]
    conditions = {rule["if"]["properties"]["type"]["const"]: rule["then"] for rule in entry["allOf"]}
    assert set(conditions) == set(registry.registered())
    for name, then in conditions.items():
        parameters = registry.find(name).parameters_type
        assert set(resolve(then, schema)["properties"]) == {*PluginEntry.model_fields, *parameters.model_fields}
    assert resolve(conditions["heartbeat"], schema)["additionalProperties"] is False


def test_a_new_plugin_is_written_with_its_name_in_all_places(ask, fail, here):
    said = ask("plugin", "new", "street_lamp")
    assert "pip install -e 'street_lamp[test]'" in said
    folder = here / "street_lamp"
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} == {
        "README.md", "pyproject.toml", "src/street_lamp/__init__.py", "src/street_lamp/plugin.py",
        "tests/test_street_lamp.py",
    }  # fmt: skip
    assert 'street_lamp = "street_lamp.plugin:StreetLamp"' in (folder / "pyproject.toml").read_text()
    for path in folder.rglob("*.py"):
        compile(path.read_text(), path, "exec")
        assert "$" not in path.read_text()
    assert "street_lamp already exists" in fail(1, "plugin", "new", "street_lamp")
    assert "elsewhere/street_lamp" in ask("plugin", "new", "street_lamp", "--into", "elsewhere")


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        (
            "Street-Lamp",
            "cannot be the name of a module: lower-case letters, digits and _ are allowed; try street_lamp",
        ),
        ("class", "cannot be the name of a module"),
        ("heartbeat", "a plugin 'heartbeat' already exists"),
        ("json", "a module 'json' already exists"),
    ],
)
def test_a_name_that_no_plugin_can_have_is_refused(fail, here, name, sentence):
    assert sentence in fail(1, "plugin", "new", name)
    assert not list(here.iterdir())


SCRIPTS = {"bash": "complete -o default -F", "zsh": "compdef", "fish": "complete --command mjplug"}


@pytest.mark.parametrize(("shell", "part"), SCRIPTS.items())
def test_a_script_for_the_shell_is_printed(ask, shell, part):
    assert part in ask("completion", shell)


def test_no_script_for_another_shell(fail):
    assert "'tcsh' is not one of 'bash', 'zsh', 'fish'" in fail(2, "completion", "tcsh")
