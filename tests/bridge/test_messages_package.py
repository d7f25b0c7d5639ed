"""The ROS package mjplug_msgs as ROS machines get it."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mjplug_schemas.ament_package import ament_package
from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.message import Message, Service
from mjplug_schemas.registry import all_types
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "msgs_ros2"
TYPES = [interface for name, interface in all_types().items() if name.startswith("mjplug_msgs/")]

# What ament_cmake and rosidl provide, as far as a build without them can go: the build type, and one call whose
# arguments are checked as rosidl checks them.
STAND_INS = {
    "ament_cmake": """
function(ament_export_dependencies)
endfunction()
function(ament_package)
  install(FILES package.xml DESTINATION share/${PROJECT_NAME})
endfunction()
""",
    "rosidl_default_generators": """
function(rosidl_generate_interfaces target)
  cmake_parse_arguments(ARG "" "" "DEPENDENCIES" ${ARGN})
  if(NOT target STREQUAL "${PROJECT_NAME}")
    message(FATAL_ERROR "the target is not named like the package")
  endif()
  foreach(package ${ARG_DEPENDENCIES})
    if(NOT ${package}_FOUND)
      message(FATAL_ERROR "${package} was not found before")
    endif()
  endforeach()
  foreach(file ${ARG_UNPARSED_ARGUMENTS})
    get_filename_component(folder ${file} DIRECTORY)
    install(FILES ${file} DESTINATION share/${PROJECT_NAME}/${folder})
  endforeach()
endfunction()
""",
    "builtin_interfaces": "",
}


def test_the_package_is_what_the_schemas_define():
    spec = importlib.util.spec_from_file_location("msgs", ROOT / ".ci" / "msgs.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    present = {str(path.relative_to(PACKAGE)): path.read_text("utf-8") for path in PACKAGE.rglob("*") if path.is_file()}
    assert present == script.files(), "run: make msgs"


def test_every_file_parses_to_the_type_that_the_server_has():
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in PACKAGE.glob("msg/*.msg"):
        store.register(get_types_from_msg(path.read_text("utf-8"), f"mjplug_msgs/msg/{path.stem}"))
    parts = {}
    for path in PACKAGE.glob("srv/*.srv"):
        for part, text in zip(("Request", "Response"), path.read_text("utf-8").split("---\n"), strict=True):
            name = f"mjplug_msgs/srv/{path.stem}_{part}"
            # rosbags would turn pkg/srv/X into pkg/srv/msg/X, so the text is parsed under another name.
            parts[name] = get_types_from_msg(text, "parsed/msg/Parsed")["parsed/msg/Parsed"]
    store.register(parts)
    expected = {}
    for interface in TYPES:
        both = (interface.Request, interface.Response) if issubclass(interface, Service) else (interface,)
        expected |= {part.TYPE: type_hash(part) for part in both}
    assert len(expected) == 20
    assert {name: store.hash_rihs01(name) for name in expected} == expected


def test_the_package_names_every_package_that_it_uses_and_no_other():
    root = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert [element.text for element in root.findall("depend")] == ["builtin_interfaces"]
    assert root.findtext("member_of_group") == "rosidl_interface_packages"


def test_a_package_without_messages_of_others_has_no_dependencies():
    files = ament_package([Trigger], "1.0.0", "Text with < and &.", ("A & B", "a@b.invalid"))
    root = ElementTree.fromstring(files["package.xml"])
    assert (root.findtext("name"), root.findtext("description")) == ("std_srvs", "Text with < and &.")
    assert root.findall("depend") == []
    assert "DEPENDENCIES" not in files["CMakeLists.txt"]
    assert set(files) == {"package.xml", "CMakeLists.txt", "srv/Trigger.srv"}


@pytest.mark.parametrize("types", [[], [String, Trigger]])
def test_a_package_is_made_of_one_ros_package(types):
    with pytest.raises(DefinitionError, match="give those of one package"):
        ament_package(types, "1.0.0", "Nothing.", ("A", "a@b.invalid"))


def test_no_field_hides_a_method_of_messages():
    for interface in TYPES:
        for part in (interface.Request, interface.Response) if issubclass(interface, Service) else (interface,):
            assert not [name for name in part.model_fields if hasattr(Message, name)]


@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("cc") is None, reason="needs cmake and a compiler")
def test_colcon_builds_the_package(tmp_path):
    source, stand_ins = tmp_path / "src" / "mjplug_msgs", tmp_path / "stand_ins"
    shutil.copytree(PACKAGE, source)
    for name, text in STAND_INS.items():
        folder = stand_ins / "share" / name / "cmake"
        folder.mkdir(parents=True)
        (folder / f"{name}Config.cmake").write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "colcon", "build", "--event-handlers", "console_direct+"],
        cwd=tmp_path,
        env=os.environ | {"CMAKE_PREFIX_PATH": str(stand_ins)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    share = tmp_path / "install" / "mjplug_msgs" / "share" / "mjplug_msgs"
    installed = {str(path.relative_to(share)) for path in share.rglob("*.msg")} | {
        str(path.relative_to(share)) for path in share.rglob("*.srv")
    }
    assert installed == {str(path.relative_to(PACKAGE)) for path in PACKAGE.glob("*/*.*")}
