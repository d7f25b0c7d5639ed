import contextlib
from pathlib import Path

import pytest
from config.conftest import DESIGN, refusal
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mjplug.config.load import load, read
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError


def test_the_whole_documented_file_loads(config):
    settings = config(DESIGN).settings
    assert settings.remap == {"/scan": "/robot1/scan"}
    assert settings.zenoh.listen == ("tcp/127.0.0.1:7447",)
    assert settings.plugins["external_wrench"].parameters == {"force_arrow_scale": 0.01}
    assert list(settings.plugins) == ["external_wrench", "heartbeat"]


def test_all_errors_are_reported_at_once(config):
    text = """\
modle: scene.xml
node_name: on
sim:
  speed: fast
  sped: 2
  paused: "true"
  seed: 1.5
  seed: 3
  on_divergence: paus
zenoh: {mode: rooter, listen: tcp/0.0.0.0:7447, connect: [tcp://a:1, tpc/a:1], config: no.json5}
ros2: {domain_id: 233}
plugins:
  2d: {type: heartbeat}
  cam: {frame: x}
ros_params: [no.yaml]
"""
    zenoh = "   10 | zenoh: {mode: rooter, listen: tcp/0.0.0.0:7447, connect: [tcp://a:1, tpc/a:1], config: no.json5}\n"
    here = Path.cwd()
    assert refusal(config, text) == (
        "c.yaml: error: no model: write `model: FILE`, or give --model FILE\n"
        "c.yaml:1:1: error: modle: unknown key; known: frame_prefix, model, model_options, model_timeout, namespace, "
        "node_name, on_plugin_error, plugins, remap, ros2, ros_params, sim, simulation_interfaces, snapshots, zenoh\n"
        "    1 | modle: scene.xml\n"
        "      | ^ did you mean 'model'?\n"
        "c.yaml:2:12: error: node_name: Input should be text, not true\n"
        "    2 | node_name: on\n"
        '      |            ^ for text, write "on" with the quotes\n'
        "c.yaml:4:10: error: sim.speed: Input should be a number or 'max', not 'fast'\n"
        "    4 |   speed: fast\n"
        "      |          ^\n"
        "c.yaml:5:3: error: sim.sped: unknown key; known: clock_rate, hold_initial_pose, initial_positions, keyframe, "
        "on_divergence, paused, plugin_libraries, seed, speed, start_position_file\n"
        "    5 |   sped: 2\n"
        "      |   ^ did you mean 'speed'?\n"
        "c.yaml:6:11: error: sim.paused: Input should be true or false, not 'true'\n"
        '    6 |   paused: "true"\n'
        "      |           ^ leave out the quotes\n"
        "c.yaml:7:9: error: sim.seed: Input should be a whole number, not 1.5\n"
        "    7 |   seed: 1.5\n"
        "      |         ^\n"
        "c.yaml:8:3: error: duplicate key 'seed' (first on line 7)\n"
        "    8 |   seed: 3\n"
        "      |   ^\n"
        "c.yaml:9:18: error: sim.on_divergence: Input should be 'pause', 'reset' or 'stop', not 'paus'\n"
        "    9 |   on_divergence: paus\n"
        "      |                  ^ did you mean 'pause'?\n"
        "c.yaml:10:15: error: zenoh.mode: Input should be 'auto', 'router', 'peer' or 'client', not 'rooter'\n"
        f"{zenoh}"
        "      |               ^ did you mean 'router'?\n"
        "c.yaml:10:31: error: zenoh.listen: Input should be a list, not 'tcp/0.0.0.0:7447'\n"
        f"{zenoh}"
        "      |                               ^ write [tcp/0.0.0.0:7447] for a list with one item\n"
        "c.yaml:10:59: error: zenoh.connect[0]: write the endpoint 'tcp://a:1' as 'tcp/a:1'\n"
        f"{zenoh}"
        "      |                                                           ^\n"
        "c.yaml:10:70: error: zenoh.connect[1]: unknown protocol 'tpc' in 'tpc/a:1', did you mean 'tcp'?; "
        "known: tcp, udp, tls, quic, ws, unixsock-stream, unixpipe, serial, vsock\n"
        f"{zenoh}"
        "      |                                                                      ^\n"
        f"c.yaml:10:88: error: zenoh.config: there is no file 'no.json5' in {here}\n"
        f"{zenoh}"
        "      |                                                                                        ^\n"
        "c.yaml:11:19: error: ros2.domain_id: Input should be less than or equal to 232, not 233\n"
        "   11 | ros2: {domain_id: 233}\n"
        "      |                   ^\n"
        "c.yaml:13:3: error: plugins.2d: '2d' is not a valid ROS node name: '2d' must not start with a digit\n"
        "   13 |   2d: {type: heartbeat}\n"
        "      |   ^\n"
        "c.yaml:14:3: error: plugins.cam.type: required, but not given\n"
        "   14 |   cam: {frame: x}\n"
        "      |   ^\n"
        f"c.yaml:15:14: error: ros_params[0]: there is no file 'no.yaml' in {here}\n"
        "   15 | ros_params: [no.yaml]\n"
        "      |              ^"
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("sim: {speed: .inf}", "c.yaml:2:14: error: sim.speed: Input should be a finite number or 'max', not inf"),
        (
            "sim: {speed: 1e-320}",
            "c.yaml:2:14: error: sim.speed: Input should be greater than or equal to 0.001 or 'max', not 1e-320",
        ),
        (
            "sim: {speed: 1e308}",
            "c.yaml:2:14: error: sim.speed: Input should be less than or equal to 1000 or 'max', not 1e+308",
        ),
        ("sim: {speed: }", "c.yaml:2:14: error: sim.speed: Input should be a number or 'max', not nothing"),
        ("sim: fast", "c.yaml:2:6: error: sim: Input should be a mapping, not 'fast'"),
        ("sim: []", "c.yaml:2:6: error: sim: Input should be a mapping, not an empty list"),
        ("namespace: a-b", "c.yaml:2:12: error: namespace: 'a-b' is not a valid ROS namespace: '-' is not allowed; "
         "use letters of the English alphabet, digits, '_' and '/'"),
        ("remap: {scan: /a}", "c.yaml:2:9: error: remap.scan: 'scan' is not a valid ROS name: "
         "a full name must start with '/'"),
        ("remap: {/a: b}", "c.yaml:2:13: error: remap./a: 'b' is not a valid ROS name: "
         "a full name must start with '/'"),
        ("plugins: {a: heartbeat}", "c.yaml:2:14: error: plugins.a: Input should be a mapping, not 'heartbeat'"),
        ("on_plugin_error: [stop]", "c.yaml:2:18: error: on_plugin_error: Input should be 'stop' or 'disable', "
         "not a list"),
        ("ros_params: [c.yaml]", "c.yaml:2:14: error: ros_params[0]: 'c.yaml' is not a ROS parameter file, "
         "because it has no ros__parameters"),
    ],
)  # fmt: skip
def test_the_sentence_of_one_mistake(config, line, message):
    first, shown, caret = refusal(config, f"model: a.xml\n{line}").splitlines()
    assert first == message
    assert shown == f"    2 | {line}"
    assert caret.startswith("      | ")
    assert caret.index("^") - 8 == int(message.split(":")[2]) - 1


def test_an_empty_section_is_the_default(config):
    settings = config("model: a.xml\nsim:\nplugins:\n  # hb: {type: heartbeat}\nzenoh: ~\n").settings
    assert settings == config("model: a.xml").settings


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "c.yaml: error: the file is empty; write at least `model: FILE`"),
        ("# model: a\n", "c.yaml: error: the file is empty; write at least `model: FILE`"),
        (
            "just text",
            "c.yaml:1:1: error: a configuration must be a mapping such as `model: scene.xml`, not 'just text'\n"
            "    1 | just text\n"
            "      | ^",
        ),
        (
            "- a\n- b",
            "c.yaml:1:1: error: a configuration must be a mapping such as `model: scene.xml`, not a list\n"
            "    1 | - a\n"
            "      | ^",
        ),
    ],
)
def test_what_is_no_configuration_at_all(config, text, message):
    assert refusal(config, text) == message


def test_a_missing_file(here):
    assert refusal(load, "no.yaml", environ={}) == "no.yaml: error: no such file"
    assert refusal(load, here, environ={}) == f"{here}: error: is a directory, not a configuration file"


def test_a_model_alone_is_a_configuration(here):
    (here / "models").mkdir()
    loaded = load("models/scene.xml", environ={})
    assert loaded.settings.model == "models/scene.xml"
    assert loaded.folder == here / "models"
    assert loaded.folders(("model",)) == (here, here / "models")
    assert load("bundled:box", environ={}).settings.model == "bundled:box"
    assert load("package://p/a.urdf", environ={}).settings.model == "package://p/a.urdf"
    assert load(None, model="a.mjb", environ={}).settings.model == "a.mjb"
    assert refusal(load, "a.xml", model="b.xml", environ={}) == (
        "a.xml: error: this is a model, and --model b.xml is another one; give only one of them"
    )
    assert refusal(load, None, environ={}) == (
        "command line: error: no model: give a configuration file, or --model FILE"
    )


def test_the_folder_of_saved_states_is_relative_to_the_file_that_names_it_and_need_not_exist(here):
    folder = here / "sub"
    folder.mkdir()
    (folder / "c.yaml").write_text("model: a.xml\nsnapshots: {folder: states}\n")
    assert load("sub/c.yaml", environ={}).states_folder == folder / "states"
    assert load("sub/c.yaml", sets=["snapshots.folder=states"], environ={}).states_folder == here / "states"
    assert load("sub/c.yaml", sets=["snapshots.folder=/tmp/s"], environ={}).states_folder == Path("/tmp/s")
    assert load("bundled:box", environ={}).states_folder is None


def test_relative_names_count_from_where_they_are_written(here):
    folder = here / "sub"
    folder.mkdir()
    (folder / "c.yaml").write_text("model: a.xml\nzenoh: {config: z.json5}\n")
    (folder / "z.json5").write_text("{}")
    loaded = load("sub/c.yaml", environ={})
    assert loaded.folder == folder
    assert loaded.folders(("model",)) == (folder, here)
    assert loaded.path(("zenoh", "config")) == folder / "z.json5"
    (here / "z.json5").write_text("{}")
    assert load("sub/c.yaml", environ={}).path(("zenoh", "config")) == folder / "z.json5"
    option = load("sub/c.yaml", model="b.xml", sets=["zenoh.config=z.json5"], environ={})
    assert option.folders(("model",)) == (here, folder)
    assert option.path(("zenoh", "config")) == here / "z.json5"


def test_ros_files_beside_a_configuration(here, config):
    (here / "params.yaml").write_text(
        "/**: {ros__parameters: {mujoco_plugins: {a: {type: x, rate: 1, topic: t}, b: {type: y2}}}}"
    )
    loaded = config("model: m\nros_params: [params.yaml]\nplugins: {a: {rate: 2}, c: {type: z}}", "plugins.b.rate=3")
    assert {name: (entry.type, entry.parameters) for name, entry in loaded.settings.plugins.items()} == {
        "a": ("x", {"rate": 2, "topic": "t"}),
        "b": ("y2", {"rate": 3}),
        "c": ("z", {}),
    }
    assert str(loaded.problem(("plugins", "a", "topic"), "no such topic")) == (
        "params.yaml:1:71: error: plugins.a.topic: no such topic\n"
        "    1 | /**: {ros__parameters: {mujoco_plugins: {a: {type: x, rate: 1, topic: t}, b: {type: y2}}}}\n"
        "      |                                                                       ^"
    )
    assert "c.yaml:3:21: error: plugins.a.rate: too slow\n" in str(loaded.problem(("plugins", "a", "rate"), "too slow"))
    assert str(loaded.problem(("plugins", "b", "rate"), "too fast")) == (
        "--set plugins.b.rate=3: error: plugins.b.rate: too fast"
    )


class Camera(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    frame_name: str = ""


class Parameters(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)
    __pydantic_extra__: dict[str, Camera]
    body: str
    rate: float = Field(1.0, gt=0)
    shapes: list[Camera | int] = []


def test_plugin_parameters_are_reported_together_with_the_rest(here):
    (here / "c.yaml").write_text("""\
model: m.xml
sim: {sped: 1}
plugins:
  cam:
    type: camera
    rate: 0
    front: {frame_nam: f}
    shapes: [1, {frame_name: 2}, x]
  other: {type: nonsense}
""")
    draft = read("c.yaml", environ={})
    assert {name: entry.type for name, entry in draft.plugins.items()} == {"cam": "camera", "other": "nonsense"}
    with pytest.raises(ValidationError) as caught:
        Parameters.model_validate(draft.plugins["cam"].parameters)
    problems = draft.explain(caught.value, ("plugins", "cam"), Parameters)
    problems.append(draft.problem(("plugins", "other", "type"), "unknown plugin type 'nonsense'", "known: camera"))
    with pytest.raises(MjplugError) as all_of_it:
        draft.finish(problems)
    assert str(all_of_it.value) == (
        "c.yaml:2:7: error: sim.sped: unknown key; known: clock_rate, hold_initial_pose, initial_positions, keyframe, "
        "on_divergence, paused, plugin_libraries, seed, speed, start_position_file\n"
        "    2 | sim: {sped: 1}\n"
        "      |       ^ did you mean 'speed'?\n"
        "c.yaml:4:3: error: plugins.cam.body: required, but not given\n"
        "    4 |   cam:\n"
        "      |   ^\n"
        "c.yaml:6:11: error: plugins.cam.rate: Input should be greater than 0, not 0\n"
        "    6 |     rate: 0\n"
        "      |           ^\n"
        "c.yaml:7:13: error: plugins.cam.front.frame_nam: unknown key; known: frame_name\n"
        "    7 |     front: {frame_nam: f}\n"
        "      |             ^ did you mean 'frame_name'?\n"
        "c.yaml:8:17: error: plugins.cam.shapes[1]: Input should be a whole number, not a mapping\n"
        "    8 |     shapes: [1, {frame_name: 2}, x]\n"
        "      |                 ^\n"
        "c.yaml:8:30: error: plugins.cam.shapes[1].frame_name: Input should be text, not 2\n"
        "    8 |     shapes: [1, {frame_name: 2}, x]\n"
        '      |                              ^ for text, write "2" with the quotes\n'
        "c.yaml:8:34: error: plugins.cam.shapes[2]: Input should be a mapping or a whole number, not 'x'\n"
        "    8 |     shapes: [1, {frame_name: 2}, x]\n"
        "      |                                  ^\n"
        "c.yaml:9:17: error: plugins.other.type: unknown plugin type 'nonsense'\n"
        "    9 |   other: {type: nonsense}\n"
        "      |                 ^ known: camera"
    )
    assert len(all_of_it.value.problems) == 8


def test_a_draft_without_faults_finishes(here):
    (here / "c.yaml").write_text("model: m.xml\n")
    assert read("c.yaml", environ={}).finish().settings.model == "m.xml"


def test_warnings_are_reported_beside_errors_but_do_not_stop(here):
    (here / "p.yaml").write_text("/**: {ros__parameters: {use_sim_time: false, mujoco_plugins: {a: {type: x}}}}")
    loaded = load("p.yaml", model="m.xml", environ={})
    assert [warning.severity for warning in loaded.warnings] == ["warning"]
    assert "warning: use_sim_time" in refusal(load, "p.yaml", model="m.xml", sets=["sim.speed=0"], environ={})


names = ["model", "sim", "speed", "plugins", "type", "a", "zenoh", "listen", "remap", "/x", "ros_params", "", "a.b"]
ros_names = ["/**", "ros__parameters", "mujoco_plugins", "mujoco_plugins.a", "use_sim_time"]
key = st.sampled_from(names + ros_names)
scalar = st.sampled_from(["1", "x", "on", "'1'", "~", "[]", "{}", "1.5", "p.yaml", ".nan", "tcp/a:1", "/a"])
tree = st.recursive(
    scalar,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]")
        | st.lists(st.tuples(key, inner), max_size=4).map(
            lambda items: "{" + ", ".join(f"'{k}': {v}" for k, v in items) + "}"
        )
    ),
    max_leaves=12,
)


@given(st.lists(st.tuples(key, tree), max_size=5), st.lists(st.tuples(st.lists(key, max_size=3), tree), max_size=3))
def test_no_content_raises_anything_but_a_config_error(tmp_path_factory, content, options):
    path = tmp_path_factory.mktemp("content") / "c.yaml"
    path.write_text("\n".join(f"'{name}': {value}" for name, value in content))
    sets = [f"{'.'.join(parts)}={value}" for parts, value in options]
    environ = {f"MJPLUG_{'__'.join(parts).upper()}": value for parts, value in options}
    with contextlib.suppress(ConfigError):
        load(path, sets=sets, environ=environ)


def test_the_text_of_an_error_is_bounded_but_the_error_has_all(config):
    with pytest.raises(ConfigError) as caught:
        config("model: m\n" + "".join(f"k{i}: 1\n" for i in range(250)))
    assert len(caught.value.problems) == 250
    assert str(caught.value).splitlines()[-1] == "… and 150 more"
