import textwrap

import pytest

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import PluginError, UnknownName
from mjplug.plugin import registry
from mjplug.plugin.selection import select
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.heartbeat import Heartbeat


@pytest.mark.parametrize(
    ("name", "plugin"),
    [
        ("heartbeat", Heartbeat),
        ("external_wrench", ExternalWrench),
        ("mujoco_ros2_control_plugins/HeartbeatPublisherPlugin", Heartbeat),
        ("mujoco_ros2_control_plugins/ExternalWrenchPlugin", ExternalWrench),
        ("mjplug_plugins.heartbeat:Heartbeat", Heartbeat),
    ],
)
def test_a_plugin_is_found_by_each_of_its_names(name, plugin):
    assert registry.find(name) is plugin


def test_an_unknown_name_gets_the_nearest_and_the_known_ones():
    with pytest.raises(UnknownName, match="unknown plugin type 'hartbeat', did you mean 'heartbeat'\\?; known: "):
        registry.find("hartbeat")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("no_such_module:Class", "cannot import 'no_such_module'"),
        ("mjplug_plugins.heartbeat:Hartbeat", "module 'mjplug_plugins.heartbeat' contains no 'Hartbeat'"),
        ("mjplug_plugins.heartbeat:HeartbeatParameters", "is not a subclass of mjplug.plugin.Plugin"),
    ],
)
def test_what_is_no_plugin_is_refused_with_the_reason(name, reason):
    with pytest.raises(PluginError, match=reason):
        registry.find(name)


def write(path, text):
    path.write_text(textwrap.dedent(text))
    return path


def test_all_errors_in_settings_and_plugins_are_reported_at_once_with_their_positions(tmp_path):
    config = write(
        tmp_path / "bad.yaml",
        """\
        model: bundled:box
        sim: {sped: 2}
        plugins:
          pulse: {type: heartbeat, updat_rate: 2.0}
          push: {type: external_wrench, force_arrow_scale: large}
          other: {type: hartbeat}
        """,
    )
    with pytest.raises(ConfigError) as error:
        select(read(config, environ={}))
    text = str(error.value)
    for place, word in (("2:", "sped"), ("4:", "updat_rate"), ("5:", "force_arrow_scale"), ("6:", "hartbeat")):
        assert any(f"bad.yaml:{place}" in line and word in line for line in text.splitlines()), (place, word, text)
    assert "did you mean 'update_rate'?" in text
    assert "did you mean 'heartbeat'" in text


def test_selected_plugins_keep_the_order_of_the_file_and_their_parameters(tmp_path):
    config = write(
        tmp_path / "good.yaml",
        """\
        model: bundled:box
        plugins:
          push: {type: external_wrench}
          pulse: {type: heartbeat, update_rate: 4}
        """,
    )
    _, selected = select(read(config, environ={}))
    assert [s.name for s in selected] == ["push", "pulse"]
    assert selected[1].parameters.update_rate == 4.0


def test_modules_beside_the_configuration_file_can_be_named(tmp_path):
    write(
        tmp_path / "beside_the_config.py",
        """\
        from mjplug.plugin import Parameters, Plugin
        class Mine(Plugin[Parameters]):
            def init(self, host, parameters):
                pass
        """,
    )
    config = write(tmp_path / "c.yaml", 'model: bundled:box\nplugins: {mine: {type: "beside_the_config:Mine"}}\n')
    _, selected = select(read(config, environ={}))
    assert selected[0].plugin_class.__name__ == "Mine"
