"""Models that arrive as text from a topic: files outside of ROS packages are not read, and no code is run."""

import pytest
from model_files import tetrahedron

from convert.robots import BOX, joint, link, robot
from mjplug.convert.load import load_received
from mjplug.convert.options import ConversionOptions
from mjplug.convert.received import check_text, store
from mjplug.errors import ModelError

TOPIC = "/robot_description"


def pendulum(visual=""):
    return robot(link("base_link", shape=BOX), link("bob", visual=visual), joint("hinge", "base_link", "bob"))


PLAIN = pendulum()


class Received:
    """Loads texts, with a cache of their own.

    Attributes:
        folder: A ROS package with a mesh; `outside` is a mesh in no package.
        lines: The report of the last conversion.
    """

    def __init__(self, tmp_path):
        self.cache = tmp_path / "cache" / "mjplug"
        self.folder, self.outside = tmp_path / "ws" / "arm_description", tmp_path / "outside.stl"
        tetrahedron(self.folder / "meshes" / "part.stl", 1)
        (self.folder / "package.xml").write_text("<package><name>arm_description</name></package>")
        tetrahedron(self.outside, 1)
        self.environ = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "ROS_PACKAGE_PATH": str(tmp_path / "ws")}
        self.lines = []

    def load(self, text, **options):
        def done(robot):
            self.lines = list(robot.report().lines())

        stored = store(TOPIC, text, self.cache)
        return load_received(stored, ConversionOptions(**options), self.environ, done=done)


@pytest.fixture
def received(tmp_path):
    return Received(tmp_path)


def shown(uri):
    return pendulum(f'<mesh filename="{uri}"/>')


def test_meshes_of_packages_are_found_by_name_and_by_path(received):
    for uri in ("package://arm_description/meshes/part.stl", f"file://{received.folder}/meshes/part.stl"):
        assert received.load(shown(uri)).model.nmesh == 1


@pytest.mark.parametrize(
    "uri",
    [
        "{outside}",
        "file://{outside}",
        "{package}/../../outside.stl",
        "package://arm_description/../../outside.stl",
        "model://arm_description/../../outside.stl",
        "outside.stl",
        "../outside.stl",
    ],
)
def test_files_outside_of_packages_are_not_read(received, monkeypatch, uri):
    monkeypatch.chdir(received.outside.parent)
    loaded = received.load(shown(uri.format(outside=received.outside, package=received.folder)))
    assert loaded.model.nmesh == 0
    assert any("visual mesh left out: bob" in line and "outside.stl" in line for line in received.lines)
    with pytest.raises(ModelError, match=r"link 'bob': .*outside\.stl"):
        received.load(shown(uri.format(outside=received.outside, package=received.folder)), strict=True)


def test_a_folder_that_the_options_name_is_trusted(received):
    packages = {"any": str(received.outside.parent)}
    assert received.load(shown(str(received.outside)), packages=packages).model.nmesh == 1


FORBIDDEN = {
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="a"/><xacro:if value="${1}"/></robot>',
        "contains elements of xacro, which are not evaluated",
    ),
    "include": ('<mujoco><include file="/etc/passwd"/></mujoco>', r"MJCF from a topic cannot contain <include>"),
    "mesh": ('<mujoco><asset><mesh file="/etc/passwd"/></asset></mujoco>', r"'/etc/passwd' is in no ROS package"),
    "relative": ('<mujoco><asset><hfield file="a.png"/></asset></mujoco>', r"'a.png' is a relative path"),
    "folder": ('<mujoco><compiler strippath="true" meshdir="/etc"/></mujoco>', r"'/etc' is in no ROS package"),
    "cube": ('<mujoco><asset><texture fileright="/etc/x.png"/></asset></mujoco>', r"'/etc/x.png' is in no ROS package"),
    "inputs": (
        PLAIN.replace(
            "</robot>",
            '<mujoco_inputs><raw_inputs><asset><mesh file="/etc/passwd"/></asset></raw_inputs></mujoco_inputs></robot>',
        ),
        r"<mujoco_inputs> of the URDF on /robot_description: '/etc/passwd' is in no ROS package",
    ),
}


@pytest.mark.parametrize(("text", "sentence"), FORBIDDEN.values(), ids=FORBIDDEN)
def test_models_that_name_other_files_or_contain_code_are_refused(received, text, sentence):
    with pytest.raises(ModelError, match=sentence):
        received.load(text)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            '<mujoco><compiler meshdir="{package}/a/b"/><compiler assetdir="{package}"/><asset>{mesh}</asset></mujoco>',
            r"outside\.stl' is in no ROS package",
        ),
        (
            '<mujoco><compiler meshdir="{package}/a/b"/><compiler meshdir=""/><asset>{mesh}</asset></mujoco>',
            r"outside\.stl' is a relative path",
        ),
        ('<mujoco><include xmlns="a" file="{package}/part.xml"/></mujoco>', "cannot contain <include>"),
        (
            '<robot><link name="a"/><mujoco_inputs><raw_inputs><compiler assetdir="{package}/a/b"/>'
            "<asset>{mesh}</asset></raw_inputs></mujoco_inputs></robot>",
            r"outside\.stl' is a relative path",
        ),
    ],
    ids=["two folders", "empty folder", "namespace", "inputs"],
)
def test_no_choice_of_folders_leads_out_of_the_packages(received, text, sentence):
    with pytest.raises(ModelError, match=sentence):
        received.load(text.format(package=received.folder, mesh='<mesh file="../../outside.stl"/>'))


def test_mjcf_may_name_files_relative_to_folders_in_packages(received):
    mesh = f'<compiler meshdir="{received.folder}/meshes"/><asset><mesh name="m" file="part.stl"/></asset>'
    assert received.load(f"<mujoco>{mesh}</mujoco>").model.nmesh == 1


def test_mjcf_may_name_files_in_packages_and_is_not_converted(received):
    mesh = f'<asset><mesh name="m" file="{received.folder}/meshes/part.stl"/></asset>'
    loaded = received.load(f'<mujoco model="m">{mesh}<worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>')
    assert (loaded.name, loaded.model.nmesh, loaded.description) == ("m", 1, None)


def test_gains_are_read_only_from_packages(received):
    hardware = '<hardware><param name="pids_config_file">{}/gains.yaml</param></hardware>'
    control = '<joint name="hinge"><command_interface name="position"/></joint>'
    text = PLAIN.replace("</robot>", f'<ros2_control name="c" type="system">{hardware}{control}</ros2_control></robot>')
    for folder in (received.outside.parent, received.folder):
        (folder / "gains.yaml").write_text("n: {ros__parameters: {pid_gains: {position: {hinge: {p: 1.0}}}}}")
    servo = received.load(text.format(received.outside.parent))
    assert servo.model.actuator_biasprm[0, 1] < 0.0
    assert any("parameter file of PID gains" in line for line in received.lines)
    motor = received.load(text.format(received.folder))
    assert motor.model.actuator_biasprm[0, 1] == 0.0


def test_options_that_need_a_file_are_refused(received):
    for options, sentence in (
        ({"raw": True}, "is always converted"),
        ({"arguments": {"a": "1"}}, "no xacro arguments"),
    ):
        with pytest.raises(ModelError, match=sentence):
            received.load(PLAIN, **options)


def test_an_element_for_the_reader_of_mujoco_does_not_replace_the_conversion(received):
    loaded = received.load(PLAIN.replace("</robot>", '<mujoco><compiler meshdir="/etc"/></mujoco></robot>'))
    assert loaded.model.nu == 1
    assert any("<mujoco> is not used" in line for line in received.lines)


def test_the_same_text_is_stored_once(received):
    paths = {store(TOPIC, PLAIN, received.cache).path for _ in range(2)}
    (path,) = paths
    assert [file for file in (received.cache / "received").rglob("*") if file.is_file()] == [path]
    assert (path.name, path.read_text()) == ("robot_description.urdf", PLAIN)
    path.write_text("changed by somebody")
    assert store(TOPIC, PLAIN, received.cache).path.read_text() == PLAIN


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "it is not valid XML"),
        ("<robot>", "it is not valid XML"),
        ("<sdf/>", "its root element is <sdf>; a URDF begins with <robot>, and MJCF with <mujoco>"),
        ("<robot>" + "<a>" * 300, "more than 200 elements deep"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "document type declaration"),
    ],
)
def test_texts_that_are_no_model_are_refused(text, sentence):
    with pytest.raises(ModelError, match=sentence):
        check_text(text)
