"""The package as ROS machines get it."""

import ast
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest
from bridge.process import PYTHON, REAL, SOURCE, Bridge

MODULES = sorted((SOURCE / "mjplug_bridge_ros2").glob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_modules_need_rclpy_zenoh_and_the_standard_library_only(path):
    tree = ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 10))
    imported = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.add(node.module.partition(".")[0])
    assert imported - sys.stdlib_module_names <= {"rclpy", "zenoh", "mjplug_bridge_ros2"}


@pytest.mark.skipif(REAL, reason="real message packages bring numpy along")
def test_a_running_bridge_has_loaded_nothing_else(bridge, sim):
    sim.open_service("/go")
    own = bridge(sim.endpoint)
    own.wait_for("1 services are mapped")
    assert own.stop() == 0
    loaded = set(own.wait_for("imported: (.*)")[1].split())
    assert loaded >= {"rclpy", "zenoh", "std_srvs"}
    assert not loaded & {"numpy", "pydantic", "yaml", "mjplug", "mjplug_schemas", "mujoco"}


def test_without_zenoh_the_error_contains_the_install_command(ros_environment):
    code = "import sys; sys.modules['zenoh'] = None; from mjplug_bridge_ros2.main import main; sys.exit(main())"
    done = subprocess.run([PYTHON, "-c", code], env=ros_environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "--system-site-packages" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_description_is_the_same_in_both_files():
    told = {element.tag: element.text for element in ElementTree.parse(SOURCE / "package.xml").getroot()}
    assert f'description="{told["description"]}"' in (SOURCE / "setup.py").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """What `colcon build` makes of the folder."""
    folder = tmp_path_factory.mktemp("colcon")
    source = folder / "src" / "mjplug_bridge_ros2"
    shutil.copytree(SOURCE, source, ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run([sys.executable, "-m", "colcon", "build"], cwd=folder, check=True, capture_output=True, text=True)
    return folder / "install" / "mjplug_bridge_ros2"


def test_colcon_builds_what_ros_looks_for(installed):
    share = installed / "share"
    assert (share / "ament_index" / "resource_index" / "packages" / "mjplug_bridge_ros2").is_file()
    assert (share / "mjplug_bridge_ros2" / "package.xml").is_file()
    assert (share / "mjplug_bridge_ros2" / "launch" / "bridge.launch.py").is_file()
    assert (share / "mjplug_bridge_ros2" / "config" / "bridge.yaml").is_file()
    (package,) = installed.glob("lib/python*/site-packages/mjplug_bridge_ros2")
    assert {path.name for path in package.glob("*.py")} == {path.name for path in MODULES}


def test_the_script_that_ros2_run_starts_is_run_by_the_python_of_the_shell(
    installed, tmp_path, ros_environment, sim, request
):
    sim.open_service("/go")
    script = installed / "lib" / "mjplug_bridge_ros2" / "bridge"
    assert script.read_text(encoding="utf-8").startswith("#!/usr/bin/env python3\n")
    (site,) = installed.glob("lib/python*/site-packages")
    path = ros_environment["PYTHONPATH"].replace(str(SOURCE), str(site))
    environment = ros_environment | {"PYTHONPATH": path}
    parameters = {"connect": [sim.endpoint], "namespace": "/built"}
    own = Bridge(tmp_path, parameters, environment, command=(PYTHON, str(script)))
    request.addfinalizer(own.finish)
    own.wait_for("/sim: 0 topics and 1 services are mapped")
    assert own.stop() == 0


def test_the_launch_file_starts_what_the_package_installs():
    text = (SOURCE / "launch" / "bridge.launch.py").read_text(encoding="utf-8")
    compile(text, "bridge.launch.py", "exec")
    assert 'executable="bridge"' in text
    (script,) = re.findall(r'"(\w+) = \{NAME\}\.main:main"', (SOURCE / "setup.py").read_text().replace('f"', '"'))
    assert script == "bridge"
