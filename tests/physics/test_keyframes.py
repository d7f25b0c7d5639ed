"""Keyframes by name and by index: in a simulation, in the configuration, and in a reset."""

import json

import mujoco
import pytest
from typer.testing import CliRunner

from mjplug.cli.app import app
from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import UnknownName
from mjplug.physics.simulation import Simulation
from mjplug.plugin.selection import select
from mjplug.services import reset_world
from mjplug.testing import World
from mjplug_schemas.mujoco_ros2_control_msgs import ResetWorld

KEYS = """
<mujoco><worldbody><body><joint name="hinge"/><geom size=".1"/></body></worldbody>
  <keyframe><key qpos=".1"/><key name="up" qpos=".2"/><key name="0" qpos=".3"/><key qpos=".4"/></keyframe>
</mujoco>
"""

POSITIONS = {"0": 0.3, "1": 0.2, "2": 0.3, "3": 0.4, "up": 0.2, "03": 0.4}
"""The third keyframe is called 0, so the first has no way to be named."""

UNKNOWN = ["4", "-1", "1.0", "1 ", " 1", "+1", "\u0661", "²", "0x1", "9" * 5000, "U", "\0", "0\0"]


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(KEYS)


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "keys.xml"
    file.write_text(KEYS)
    return file


@pytest.mark.parametrize(("keyframe", "position"), POSITIONS.items())
def test_a_simulation_starts_from_a_keyframe_by_name_or_index_and_a_name_goes_first(model, keyframe, position):
    assert Simulation(model, keyframe).data.qpos[0] == position


@pytest.mark.parametrize("keyframe", UNKNOWN, ids=lambda name: repr(name[:8]))
def test_what_is_neither_a_name_nor_an_index_is_refused_with_what_there_is(model, keyframe):
    with pytest.raises(UnknownName, match=r"known: 0, 3, up$"):
        Simulation(model, keyframe)


def test_a_model_without_keyframes_has_no_index(box_model):
    with pytest.raises(UnknownName, match="there is no keyframe"):
        Simulation(box_model, "0")


@pytest.mark.parametrize(("keyframe", "position"), POSITIONS.items())
def test_a_reset_goes_to_a_keyframe_by_name_or_index(model, keyframe, position):
    world = World(model)
    reset_world.offer(world.host("mjplug"), world.loop)
    world.loop.step(10)
    response = world.call("/mjplug/reset_world", ResetWorld.Request(keyframe=keyframe)).response
    assert response == ResetWorld.Response(success=True, message=f"the world was reset to keyframe {keyframe!r}")
    assert world.data.qpos[0] == position


@pytest.mark.parametrize("written", ["3", "'3'", "up", '"0"'])
def test_the_configuration_takes_an_index_as_a_number_or_as_text(tmp_path, file, written):
    config = tmp_path / "config.yaml"
    config.write_text(f"model: keys.xml\nsim: {{keyframe: {written}}}\n")
    loaded, _ = select(read(str(config)))
    assert loaded.settings.sim.keyframe == written.strip("\"'")
    result = CliRunner().invoke(app, ["serve", str(config), "--check"])
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("written", ["-1", "1.0", "true", "[1]"])
def test_the_configuration_takes_no_other_numbers(tmp_path, file, written):
    config = tmp_path / "config.yaml"
    config.write_text(f"model: keys.xml\nsim: {{keyframe: {written}}}\n")
    with pytest.raises(ConfigError, match=r"sim\.keyframe"):
        select(read(str(config)))


@pytest.mark.parametrize("arguments", [["--keyframe", "3"], ["--set", "sim.keyframe=3"]])
def test_the_command_line_takes_an_index(file, arguments):
    assert CliRunner().invoke(app, ["serve", str(file), "--check", *arguments]).exit_code == 0


def test_the_model_s_keyframes_are_listed_with_their_index(file):
    told = CliRunner().invoke(app, ["model", "info", str(file), "keyframes", "--output", "json"]).stdout
    rows = json.loads(told)["keyframes"]
    assert [(row["name"], row["index"]) for row in rows] == [("[0]", 0), ("up", 1), ("0", 2), ("[3]", 3)]
