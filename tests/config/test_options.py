"""Options and environment variables over a configuration file."""

import pytest
from config.conftest import DESIGN, refusal


def test_set_wins_over_environment_over_file_over_default(config):
    text = "model: file.xml\nsim: {speed: 2, seed: 2, clock_rate: 2}"
    loaded = config(text, "sim.speed=4", MJPLUG_SIM__SPEED="3", MJPLUG_SIM__SEED="3", MJPLUG_MODEL="env.xml")
    assert loaded.settings.sim.model_dump(include={"speed", "seed", "clock_rate", "paused"}) == {
        "speed": 4.0,
        "seed": 3,
        "clock_rate": 2.0,
        "paused": False,
    }
    assert loaded.settings.model == "env.xml"
    assert config(text, model="option.xml", MJPLUG_MODEL="env.xml").settings.model == "option.xml"
    assert config(text, "model=set.xml", model="option.xml").settings.model == "set.xml"


@pytest.mark.parametrize(
    ("text", "environ", "domain"),
    [
        ("model: a", {}, 0),
        ("model: a", {"ROS_DOMAIN_ID": ""}, 0),
        ("model: a", {"ROS_DOMAIN_ID": "42"}, 42),
        ("model: a\nros2: {enabled: true}", {"ROS_DOMAIN_ID": "42"}, 42),
        ("model: a\nros2: {domain_id: 3}", {"ROS_DOMAIN_ID": "42"}, 3),
        ("model: a", {"ROS_DOMAIN_ID": "42", "MJPLUG_ROS2__DOMAIN_ID": "5"}, 5),
    ],
)
def test_ros_domain_id_is_used_unless_a_domain_is_configured(config, text, environ, domain):
    assert config(text, **environ).settings.ros2.domain_id == domain


def test_a_wrong_domain_of_ros_is_named(config):
    assert refusal(config, "model: a", ROS_DOMAIN_ID="many") == (
        "environment ROS_DOMAIN_ID: error: ros2.domain_id: Input should be a whole number, not 'many'"
    )


def test_option_values_follow_the_rules_of_the_file(config):
    loaded = config(
        DESIGN,
        "zenoh.connect=[tcp/a:1, tcp/b:2]",
        "zenoh.listen.0=tcp/0.0.0.0:7447",
        "sim={speed: 1e1, seed: 012}",
        "namespace=",
        "plugins.hb={type: heartbeat, on: on, text: '1'}",
        "plugins.heartbeat.topic=\"on\"",
        "plugins.heartbeat.note=#1: @x=y",
        MJPLUG_NAMESPACE="r1",
        MJPLUG_PLUGINS__EXTERNAL_WRENCH__FORCE_ARROW_SCALE="0.5",
        MJPLUG_REMAP="{/a: /b}",
    )  # fmt: skip
    settings = loaded.settings
    assert settings.zenoh.connect == ("tcp/a:1", "tcp/b:2")
    assert settings.zenoh.listen == ("tcp/0.0.0.0:7447",)
    assert (settings.sim.speed, settings.sim.seed) == (10.0, 10)
    assert settings.namespace == ""
    assert settings.plugins["hb"].parameters == {"on": True, "text": "1"}
    assert settings.plugins["heartbeat"].parameters == {"topic": "on", "note": "#1: @x=y"}
    assert settings.plugins["external_wrench"].parameters == {"force_arrow_scale": 0.5}
    assert settings.remap == {"/a": "/b"}


def test_a_variable_matches_an_instance_in_any_case(config):
    loaded = config("model: a\nplugins: {HeartBeat: {type: x}}", MJPLUG_PLUGINS__HEARTBEAT__RATE="2")
    assert loaded.settings.plugins["HeartBeat"].parameters == {"rate": 2}


def test_wrong_options_say_which_they_are(config):
    assert refusal(
        config,
        DESIGN,
        "sim.speed=-1",
        "sim.sped=2",
        "foo",
        "=1",
        "model.x=1",
        "zenoh.listen.1=tcp/a:1",
        "ros2.domain_id=[1",
        "plugins.heartbat.rate=1",
        "node_name=on",
        "sim.seed='2'",
        MJPLUG_SIM_SPEED="1",
        MJPLUG_SIM__PAUSED="maybe",
        MJPLUG_LOG_LEVEL="debug",
        MJPLUGIN="x",
        PATH="/bin",
    ).splitlines() == [
        "environment MJPLUG_SIM_SPEED: error: there is no setting with this name; did you mean 'MJPLUG_SIM__SPEED'?",
        "--set foo: error: it is not path=value; write for example sim.speed=2",
        "--set =1: error: it is not path=value; write for example sim.speed=2",
        "--set model.x=1: error: model is 'scene.xml'; it cannot contain 'x'",
        "--set zenoh.listen.1=tcp/a:1: error: zenoh.listen is a list; it cannot contain '1'",
        "--set ros2.domain_id=[1: error: YAML syntax: did not find expected ',' or ']' while parsing a flow sequence",
        '--set node_name=on: error: node_name: Input should be text, not true; for text, write "on" with the quotes',
        "--set sim.speed=-1: error: sim.speed: Input should be greater than or equal to 0.001 or 'max', not -1",
        "environment MJPLUG_SIM__PAUSED: error: sim.paused: Input should be true or false, not 'maybe'",
        "--set sim.seed='2': error: sim.seed: Input should be a whole number, not '2'; leave out the quotes",
        "--set sim.sped=2: error: sim.sped: unknown key; "
        "known: clock_rate, hold_initial_pose, initial_positions, keyframe, on_divergence, paused, "
        "plugin_libraries, seed, speed, "
        "start_position_file; did you mean 'speed'?",
        "--set plugins.heartbat.rate=1: error: plugins.heartbat.type: required, but not given; "
        "did you mean 'heartbeat'?",
    ]


def test_an_option_for_a_section_replaces_the_section_of_the_file(config):
    assert config("model: a\nsim: {nonsense: 1}", "sim={}").settings.sim.speed == 1.0


def test_a_name_in_the_namespace_needs_no_quotes_as_an_option(config):
    text = "model: a\nplugins: {lidar: {type: lidar}}"
    assert config(text, "plugins.lidar.topic={ns}/scan").settings.plugins["lidar"].parameters == {"topic": "{ns}/scan"}


@pytest.mark.parametrize(
    "text", ["model: a\nremap:\n  /clock: {ns}/clock\n", "model: a\nremap: {/clock: {ns}/clock}\n"]
)
def test_a_name_in_the_namespace_without_quotes_in_a_file_gets_the_advice_to_add_them(config, text):
    assert refusal(config, text).endswith("^ write a name that begins with '{ns}' in quotes, such as \"{ns}/scan\"")
    assert config("model: a\nremap: {/clock: '{ns}/clock'}").settings.remap == {"/clock": "{ns}/clock"}


def test_the_keys_of_an_entry_are_checked_together_with_the_rest(config):
    text = "model: a\nplugins:\n  a: {type: heartbeat, namespace: 9a, frame_prefix: /b, rate: 1}\n"
    told = refusal(config, text)
    assert "plugins.a.namespace: '9a' is not a valid ROS namespace" in told
    assert "plugins.a.frame_prefix: a frame prefix must not contain spaces" in told
