"""The documentation of the bridge matches its behaviour."""

import re
import shlex
import subprocess

import pytest
import yaml
from docs.markdown import blocks_of, rows, section

from mjplug_bridge_ros2.settings import DEFAULTS, read_settings

PAGE = "bridge.md"
BASH = [block for block in blocks_of(PAGE) if block.language == "bash"]
PROGRAMS = {"source", "sudo", "python3", "~/mjplug_ros/bin/pip", "mkdir", "cp", "cd", "colcon", "ros2", "docker"}


def as_told(value):
    return f"`{value}`" if not isinstance(value, str | list) else "`" + re.sub("'", '"', repr(value)) + "`"


def test_every_parameter_has_a_row_with_its_default_and_there_are_no_others():
    assert {name: row[0] for name, row in rows(section(PAGE, "Parameters")).items()} == {
        name: as_told(default) for name, default in DEFAULTS.items()
    }


@pytest.mark.parametrize("block", BASH, ids=lambda block: block.name)
def test_commands_for_machines_with_ros_can_be_read_by_their_shell(block):
    subprocess.run(["bash", "-n"], input=block.text, text=True, check=True)
    for line in block.text.splitlines():
        assert shlex.split(line)[0] in PROGRAMS, line


class Node:
    """As much of a node as parameters need."""

    def __init__(self, given):
        self._values = dict(given)

    def declare_parameter(self, name, default):
        self._values.setdefault(name, default)

    def get_parameter(self, name):
        return type("Parameter", (), {"value": self._values[name]})


def test_the_parameters_in_the_example_are_right():
    (block,) = [block for block in blocks_of(PAGE) if block.language == "yaml"]
    assert block.info == "bridge"
    given = yaml.safe_load(block.text)["/mjplug_bridge"]["ros__parameters"]
    overrides = given.pop("qos_overrides")
    settings = read_settings(Node(given))
    assert set(given) <= set(DEFAULTS)
    assert settings.naming.ros_name("/scan") in overrides
    assert settings.naming.ros_name("/mjplug/epoch") is None
    assert settings.naming.ros_name("/odom") == "/sim/odom"
