"""`mjplug config show` prints a configuration that means the same as the one that it describes."""

from mjplug.cli.config_effective import effective
from mjplug.config.instance_names import instance_names
from mjplug.config.load import read
from mjplug.plugin.selection import select

REFERENCE = "mujoco_ros2_control_plugins/"

CONFIG = {
    "model": "bundled:arm",
    "namespace": "robot1",
    "plugins": {
        "documented": {"type": f"{REFERENCE}HeartbeatPublisherPlugin"},
        "moved": {"type": f"{REFERENCE}HeartbeatPublisherPlugin", "namespace": "arm"},
        "substituted": {"type": f"{REFERENCE}HeartbeatPublisherPlugin", "topic": "{ns}/beat"},
        "own": {"type": "heartbeat"},
    },
}


def topics(config):
    """The full topic name of each heartbeat."""
    loaded, plugins = select(read(config, environ={}))
    return loaded, plugins, {
        plugin.name: instance_names(loaded.settings, plugin.name).full_name(plugin.parameters.topic)
        for plugin in plugins
    }  # fmt: skip


def test_the_names_of_every_instance_stay_when_the_output_is_read(tmp_path):
    loaded, plugins, before = topics(CONFIG)
    assert before == {
        "documented": "/mujoco_heartbeat",
        "moved": "/robot1/arm/mujoco_heartbeat",
        "substituted": "/robot1/beat",
        "own": "/robot1/mujoco_heartbeat",
    }
    shown = tmp_path / "shown.yaml"
    shown.write_text("\n".join(effective(loaded, plugins)))
    assert topics(shown)[2] == before
