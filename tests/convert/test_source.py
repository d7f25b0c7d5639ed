"""URDF and xacro files: arguments, packages and errors."""

import subprocess
import sys

import pytest

from convert.robots import ARM, converted_file
from mjplug.convert.source import read_source
from mjplug.errors import ModelError
from mjplug.model.packages import Packages

XACRO = """<robot name="{name}" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="2.0"/>
<xacro:macro name="block" params="id"><link name="${{id}}"><inertial><mass value="${{2*$(arg mass)}}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></xacro:macro>
{body}</robot>"""
CALL = '<xacro:block id="$(arg label)"/>'


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_xacro_is_expanded_with_its_arguments(tmp_path):
    file = write(tmp_path / "robot.urdf.xacro", XACRO.format(name="r", body=CALL))
    conversion, model = converted_file(file, arguments={"label": "thing", "mass": "3"})
    assert model.body("thing").mass[0] == 6.0
    assert b"xacro" not in conversion.files["robot.urdf"].replace(b"robot.urdf.xacro", b"")


def test_a_missing_argument_is_named_with_all_arguments(tmp_path):
    file = write(tmp_path / "robot.urdf.xacro", XACRO.format(name="r", body=CALL))
    with pytest.raises(ModelError) as caught:
        read_source(file, {}, Packages({}))
    assert str(caught.value) == (
        f"{file}: xacro needs a value for the argument 'label'; add label:=VALUE (arguments of this file: mass, label)"
    )


def test_an_argument_that_the_file_does_not_have_is_refused(tmp_path):
    file = write(tmp_path / "robot.urdf.xacro", XACRO.format(name="r", body=CALL))
    with pytest.raises(
        ModelError, match=r"has no argument 'labl', did you mean 'label'\?; its arguments are mass, label"
    ):
        read_source(file, {"labl": "x"}, Packages({}))
    urdf = write(tmp_path / "robot.urdf", ARM)
    with pytest.raises(ModelError, match="does not use xacro, so it has no arguments; these were given: a"):
        read_source(urdf, {"a": "1"}, Packages({}))


def test_arguments_in_single_quotes_are_known(tmp_path):
    file = write(
        tmp_path / "robot.urdf.xacro",
        "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arg name='label' default='a'/>"
        "<link name='${xacro.arg(\"label\")}'/></robot>",
    )
    assert read_source(file, {"label": "b"}, Packages({})).root[0].get("name") == "b"


def test_a_file_with_macros_only_says_so(tmp_path):
    file = write(tmp_path / "macros.xacro", XACRO.format(name="r", body=""))
    with pytest.raises(ModelError, match=r"contains no link; it only defines macros \(block\)"):
        read_source(file, {}, Packages({}))


def test_files_of_other_packages_are_included_without_ros(tmp_path):
    other = tmp_path / "parts_clone"
    write(other / "package.xml", "<package><name>parts</name></package>")
    write(other / "part.xacro", XACRO.format(name="", body=""))
    text = '<xacro:include filename="$(find parts)/part.xacro"/><xacro:block id="thing"/>'
    main = f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}</robot>'
    file = write(tmp_path / "robots" / "robot.xacro", main)
    root = read_source(file, {}, Packages({}, file.parent)).root
    assert [link.get("name") for link in root.iterfind("link")] == ["thing"]
    write(file, main.replace("find parts", "find nothing"))
    with pytest.raises(
        ModelError, match=r"there is no package 'nothing' in .*; give its folder: --package nothing=FOLDER"
    ):
        read_source(file, {}, Packages({}, file.parent))
    assert "ament_index_python" not in sys.modules


def test_a_package_can_be_given(tmp_path):
    write(tmp_path / "somewhere" / "part.xacro", XACRO.format(name="", body=""))
    text = '<xacro:include filename="$(find parts)/part.xacro"/><xacro:block id="thing"/>'
    file = write(
        tmp_path / "a" / "r.xacro", f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}</robot>'
    )
    packages = Packages({}, file.parent, {"parts": tmp_path / "somewhere"})
    assert read_source(file, {}, packages).root.find("link") is not None


def test_a_urdf_that_uses_xacro_is_expanded_and_others_evaluate_nothing(tmp_path):
    file = write(tmp_path / "robot.urdf", XACRO.format(name="r", body=CALL))
    assert read_source(file, {"label": "x"}, Packages({})).root.find("link").get("name") == "x"
    write(file, file.read_text().replace("www.ros.org", "ros.org"))
    assert read_source(file, {"label": "y"}, Packages({})).root.find("link").get("name") == "y"
    harmless = ARM.replace('name="arm"', 'name="${1/0}"', 1)
    file = write(tmp_path / "plain.urdf", harmless)
    assert read_source(file, {}, Packages({})).root.get("name") == "${1/0}"


@pytest.mark.parametrize(
    "body", ["${1/0}", "<xacro:nothing/>", '<xacro:include filename="no.xacro"/>', "$(arg", "<link></lin>"]
)
def test_errors_of_xacro_are_one_sentence_with_the_file(tmp_path, body):
    file = write(tmp_path / "robot.xacro", XACRO.format(name="r", body=body + "<link name='a'/>"))
    with pytest.raises(ModelError, match=r"robot\.xacro"):
        read_source(file, {}, Packages({}))


def test_without_xacro_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    file = write(tmp_path / "robot.xacro", XACRO.format(name="r", body=CALL))
    with pytest.raises(ModelError) as caught:
        read_source(file, {"label": "x"}, Packages({}))
    assert str(caught.value) == (
        "the xacro file robot.xacro needs the Python library `xacro`, which is not installed: pip install "
        "'mjplug[convert]'"
    )


def test_packages_come_from_the_environment_first(tmp_path):
    for place in ("prefix/share/arm", "ros/arm", "near/arm"):
        write(tmp_path / place / "file", "")
    near = tmp_path / "near"
    environ = {"AMENT_PREFIX_PATH": str(tmp_path / "prefix"), "ROS_PACKAGE_PATH": str(tmp_path / "ros")}
    assert Packages(environ, near).file("arm", "file") == tmp_path / "prefix" / "share" / "arm" / "file"
    del environ["AMENT_PREFIX_PATH"]
    assert Packages(environ, near).file("arm", "file") == tmp_path / "ros" / "arm" / "file"
    assert Packages({}, near).file("arm", "file") == near / "arm" / "file"
    assert Packages({}, near).file("leg", "file") is None


def test_reading_options_imports_no_heavy_library():
    heavy = "('mujoco', 'numpy', 'xacro', 'trimesh')"
    code = f"import sys, mjplug.convert.options; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
