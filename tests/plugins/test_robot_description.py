"""The description of the robot, as files have it."""

from pathlib import Path

import mujoco
import pytest

from mjplug.config.load import read
from mjplug.contracts.transport import LATCHED
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.simulation import Simulation
from mjplug.plugin.selection import select
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.testing import FakeTransport, World
from mjplug_plugins.robot_description import RobotDescription

URDF = '<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'  # noqa: E501

MJCF = '<mujoco model="m"><worldbody><body name="b"><freejoint/><geom size=".1"/></body></worldbody></mujoco>\n'


@pytest.fixture
def describe(tmp_path, box_model):
    def describe(model_file=None, **parameters):
        world = World(box_model)
        host = world.host("description", model_file=model_file, folders=[tmp_path])
        RobotDescription().init(host, RobotDescription.parameters_type(**parameters))
        assert world.transport.qos["/robot_description"] == LATCHED
        (message,) = world.published("/robot_description")
        return message.data

    return describe


def test_without_a_file_the_model_describes_itself(describe, tmp_path):
    for name, text in (("robot.urdf", URDF), ("scene.xml", MJCF)):
        file = tmp_path / name
        file.write_text(text)
        assert describe(file) == text


def test_a_file_counts_from_the_folder_of_the_configuration_and_takes_the_place_of_the_model(describe, tmp_path):
    (tmp_path / "scene.xml").write_text(MJCF)
    (tmp_path / "robot.urdf").write_text(URDF)
    assert describe(tmp_path / "scene.xml", file="robot.urdf") == URDF
    assert describe(None, file=str(tmp_path / "robot.urdf")) == URDF


def test_the_mark_that_some_editors_put_first_is_not_part_of_it(describe, tmp_path):
    (tmp_path / "robot.urdf").write_text(URDF, encoding="utf-8-sig")
    assert describe(file="robot.urdf") == URDF


def test_a_model_that_includes_others_is_published_as_one_file(describe, tmp_path):
    (tmp_path / "part.xml").write_text(MJCF)
    scene = tmp_path / "scene.xml"
    scene.write_text('<mujoco><include file="part.xml"/></mujoco>')
    text = describe(scene)
    assert "include" not in text
    assert mujoco.MjModel.from_xml_string(text).body("b").id == 1


def test_the_models_that_come_along_describe_themselves(describe):
    loaded = load_model("bundled:arm")
    text = describe(loaded.path)
    assert text == Path(loaded.path).read_text()
    assert mujoco.MjModel.from_xml_string(text).nbody == loaded.model.nbody


def test_what_is_no_description_stops_the_start(describe, tmp_path):
    (tmp_path / "broken.urdf").write_text("<robot>")
    (tmp_path / "bytes.urdf").write_bytes(b"\xff\xfe\xff")
    (tmp_path / "scene.mjb").write_bytes(b"")
    (tmp_path / "scene.xml").write_text('<mujoco><include file="none.xml"/></mujoco>')
    for model_file, parameters, sentence in (
        (None, {}, "the model was not loaded from a file; set `file`"),
        (tmp_path / "scene.mjb", {}, "scene.mjb is a compiled model"),
        (tmp_path / "scene.xml", {}, "includes other files and they cannot be merged"),
        (None, {"file": "broken.urdf"}, "is not XML"),
        (None, {"file": "bytes.urdf"}, "cannot be read"),
        (None, {"file": "brken.urdf"}, "did you mean 'broken.urdf'"),
    ):
        with pytest.raises(MjplugError, match=sentence):
            describe(model_file, **parameters)


def test_in_a_configuration_the_file_counts_from_its_folder_wherever_the_server_is_started(tmp_path, monkeypatch):
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "robot.urdf").write_text(URDF)
    (folder / "robot.yaml").write_text(
        "model: bundled:box\nplugins: {description: {type: robot_description, file: robot.urdf}}\n"
    )
    monkeypatch.chdir(tmp_path)
    loaded, plugins = select(read(folder / "robot.yaml"))
    transport = FakeTransport()
    simulation = Simulation(load_model("bundled:box").model)
    Server(loaded.settings, simulation, transport, plugins, OfflineWorkerPool()).cleanup()
    assert transport.publishers["/robot_description"].messages[0].data == URDF
