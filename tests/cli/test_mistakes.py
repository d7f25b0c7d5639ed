"""What a wrong file, model or option is met with: the exit code, and all that is wrong, at once and in place."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import pytest
from cli.process import run

ROS_FILE = """\
/**:
  ros__parameters:
    mujoco_plugins:
      pulse: {type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin, update_rate: "2"}
"""
OTHER_ROS_FILE = "/other_node: {ros__parameters: {mujoco_plugins: {hb: {type: heartbeat}}}}\n"
BODY = '<mujoco><worldbody><body name="cube"><freejoint/>{}</body></worldbody></mujoco>'


@dataclass(frozen=True)
class Mistake:
    """The arguments of `serve`, its files, and parts of the expected text, in this order."""

    arguments: str
    code: int
    says: list[str]
    files: dict[str, str] = field(default_factory=dict)
    env: dict[str, str] = field(default_factory=dict)


CONFIGURATIONS = {
    "malformed YAML": Mistake(
        "config.yaml",
        3,
        [
            "config.yaml:3:4: error: YAML syntax: did not find expected ',' or ']'",
            "    3 | sim: {\n      |    ^\n",
        ],
        {"config.yaml": "model: bundled:box\nplugins: [a\nsim: {"},
    ),
    "an unknown key": Mistake(
        "config.yaml",
        3,
        [
            "config.yaml:3:3: error: sim.sped: unknown key; "
            "known: clock_rate, hold_initial_pose, initial_positions, keyframe, on_divergence, paused, "
            "plugin_libraries, seed, speed, "
            "start_position_file\n"
            "    3 |   sped: 2.0\n"
            "      |   ^ did you mean 'speed'?\n",
        ],
        {"config.yaml": "model: bundled:box\nsim:\n  sped: 2.0\n"},
    ),
    "several mistakes": Mistake(
        "config.yaml",
        3,
        [
            "config.yaml:3:14: error: sim.speed: Input should be greater than or equal to 0.001 or 'max', not -1.0\n",
            "config.yaml:3:28: error: sim.paused: Input should be true or false, not 'maybe'\n",
            "config.yaml:5:27: error: plugins.beat.update_rat: unknown key; known: topic, update_rate\n"
            "    5 |   beat: {type: heartbeat, update_rat: 3.0}\n"
            "      |                           ^ did you mean 'update_rate'?\n",
            "config.yaml:6:16: error: plugins.push.type: unknown plugin type 'external_wrnch', "
            "did you mean 'external_wrench'?; known: ",
            "config.yaml:7:41: error: plugins.pulse.update_rate: Input should be a number, not 'fast'\n",
            "config.yaml:8:16: error: plugins.mine.type: plugin 'nowhere:Class': cannot import 'nowhere'",
            "config.yaml:9:16: error: plugins.json.type: plugin 'json:JSONDecoder': "
            "json:JSONDecoder is not a subclass of mjplug.plugin.Plugin\n",
            "config.yaml:10:16: error: plugins.none.type: plugin 'json:Nothing': module 'json' contains no 'Nothing'\n",
        ],
        {
            "config.yaml": "# comment\nmodel: bundled:box\nsim: {speed: -1.0, paused: maybe}\nplugins:\n"
            "  beat: {type: heartbeat, update_rat: 3.0}\n"
            "  push: {type: external_wrnch}\n"
            "  pulse: {type: heartbeat, update_rate: fast}\n"
            '  mine: {type: "nowhere:Class"}\n'
            '  json: {type: "json:JSONDecoder"}\n'
            '  none: {type: "json:Nothing"}\n'
        },
    ),
    "a file that is not there": Mistake("nofile.yaml", 3, ["nofile.yaml: error: no such file\n"]),
    "no model": Mistake("c.yaml", 3, ["c.yaml: error: no model: write `model: FILE`"], {"c.yaml": "sim: {}"}),
    "a ROS file without a model, and a wrong parameter in it": Mistake(
        "ros.yaml",
        3,
        [
            "ros.yaml: error: no model: a ROS parameter file contains no model; give --model FILE\n",
            "ros.yaml:4:88: error: plugins.pulse.update_rate: Input should be a number, not '2'\n",
            "^ leave out the quotes\n",
        ],
        {"ros.yaml": ROS_FILE},
    ),
    "a ROS file for another node": Mistake(
        "ros.yaml --model bundled:box",
        3,
        ["no section with mujoco_plugins applies to the node '/mjplug'", "'/other_node'"],
        {"ros.yaml": OTHER_ROS_FILE},
    ),
    "a module with a syntax error": Mistake(
        "c.yaml",
        3,
        ["c.yaml:2:21: error: plugins.p.type: plugin 'own:Own'", "own.py"],
        {"c.yaml": 'model: bundled:box\nplugins: {p: {type: "own:Own"}}\n', "own.py": "def ("},
    ),
    "a module that fails": Mistake(
        "c.yaml",
        3,
        ["c.yaml:2:21: error: plugins.p.type: plugin 'own:Own'", "ZeroDivisionError"],
        {"c.yaml": 'model: bundled:box\nplugins: {p: {type: "own:Own"}}\n', "own.py": "1 / 0"},
    ),
}

MODELS = {
    "a model that is not there": Mistake("nofile.xml", 4, ["error: there is no model 'nofile.xml' in "]),
    "an unknown bundled model": Mistake(
        "bundled:bx", 4, ["unknown bundled model 'bx', did you mean 'box'?; known: arm, box, mobile_base, quadruped\n"]
    ),
    "a broken model": Mistake(
        "m.xml", 4, ["m.xml: XML Error: invalid keyword: 'bx'"], {"m.xml": BODY.format('<geom type="bx"/>')}
    ),
    "a model with a mesh that is not there": Mistake(
        "m.xml",
        4,
        ["m.xml: Error: Error opening file 'no.stl'\n"],
        {"m.xml": '<mujoco><asset><mesh file="no.stl"/></asset></mujoco>'},
    ),
}

OPTIONS = {
    "an unknown keyframe": Mistake(
        "bundled:arm --keyframe hme",
        3,
        ["--keyframe hme: error: ", "unknown keyframe 'hme', did you mean 'home'?; known: home, start_90\n"],
    ),
    "an unknown plugin": Mistake(
        "bundled:box --plugin heart_beat",
        3,
        ["--plugin heart_beat: ", "did you mean 'heartbeat'?; known: "],
    ),
    "an unknown plugin with a name": Mistake(
        "bundled:box --plugin heart_beat:pulse", 3, ["'heart_beat", "did you mean 'heartbeat'?"]
    ),
    "a speed that is none": Mistake(
        "bundled:box --speed fast", 3, ["--speed fast: error: sim.speed: Input should be a number or 'max', not 'fast'"]
    ),
    "a name that no plugin can have": Mistake("bundled:box --plugin heartbeat:a.b", 3, ["'a.b' is not a valid ROS"]),
    "two plugins of one name": Mistake(
        "bundled:box --plugin heartbeat --plugin heartbeat", 2, ["two plugins have the name 'heartbeat'"]
    ),
    "a variable that is not there": Mistake(
        "bundled:box",
        3,
        [
            "environment MJPLUG_SIMM__SPEED: error: there is no setting with this name; "
            "did you mean 'MJPLUG_SIM__SPEED'?\n"
        ],
        env={"MJPLUG_SIMM__SPEED": "2"},
    ),
    "an endpoint that is none": Mistake(
        "bundled:box --listen 127.0.0.1:7447",
        3,
        [
            "--listen 127.0.0.1:7447: error: ",
            "'127.0.0.1:7447' is not a Zenoh endpoint; write protocol/address, such as tcp/127.0.0.1:7447\n",
        ],
    ),
    "an address of another machine": Mistake(
        "bundled:box --listen tcp/192.0.2.1:7777", 5, ["error: cannot listen on tcp/192.0.2.1:7777: "]
    ),
    "a server that is not there": Mistake(
        "bundled:box --connect tcp/127.0.0.1:1 --set zenoh.mode=client",
        5,
        ["error: cannot connect to tcp/127.0.0.1:1: "],
    ),
    "no configuration at all": Mistake("", 2, ["Missing argument 'CONFIG|MODEL'"]),
    "an option that is not there": Mistake("bundled:box --duratoin 1", 2, ["No such option: --duratoin", "--duration"]),
}

MISTAKES = CONFIGURATIONS | MODELS | OPTIONS


@pytest.fixture(scope="module")
def made(request, tmp_path_factory):
    """Makes the mistakes that were selected, two at a time, since each takes a second."""

    def make(mistake):
        folder = tmp_path_factory.mktemp("mistake")
        for name, text in mistake.files.items():
            (folder / name).write_text(text)
        return run("serve", *mistake.arguments.split(), "--quiet", cwd=folder, env=mistake.env)

    selected = [item.callspec.params["name"] for item in request.session.items if item.module is request.module]
    with ThreadPoolExecutor(2) as pool:
        yield {name: pool.submit(make, MISTAKES[name]) for name in selected}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_refused_with_its_exit_code_and_its_place(made, name):
    mistake, done = MISTAKES[name], made[name].result()
    rest = done.stderr
    for part in mistake.says:
        assert part in rest, done.stderr
        rest = rest.partition(part)[2]
    assert (done.returncode, done.stdout) == (mistake.code, "")
    assert "Traceback" not in done.stderr
