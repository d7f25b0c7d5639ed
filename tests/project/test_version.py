"""pyproject.toml defines the version; every other place that shows one agrees with it."""

import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import mjplug

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_installed_package_and_its_attribute_have_the_version_of_the_project():
    assert version("mjplug") == PROJECT["version"], "run: make setup"
    assert mjplug.__version__ == PROJECT["version"]


def test_an_attribute_that_does_not_exist_is_an_error():
    with pytest.raises(AttributeError, match="no attribute '__versoin__'"):
        mjplug.__versoin__  # noqa: B018


def test_importing_the_package_does_not_look_up_the_version():
    code = "import sys, mjplug; sys.exit('importlib.metadata' in sys.modules)"
    assert subprocess.run([sys.executable, "-I", "-c", code], check=False).returncode == 0


def test_the_citation_has_version_licence_and_repository_of_the_project():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert citation.get("repository-code") == PROJECT.get("urls", {}).get("Repository")


def test_the_ros_package_has_the_version_of_the_project():
    folder = ROOT / "bridge_ros2"
    assert ElementTree.parse(folder / "package.xml").findtext("version") == PROJECT["version"]
    shown = subprocess.run(
        [sys.executable, "setup.py", "--version"], cwd=folder, capture_output=True, text=True, check=True
    )
    assert shown.stdout.split()[-1] == PROJECT["version"]


def test_the_package_of_messages_has_the_version_of_the_project():
    assert ElementTree.parse(ROOT / "msgs_ros2" / "package.xml").findtext("version") == PROJECT["version"]


def test_the_lock_file_has_the_version_of_the_project():
    packages = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
    assert [package["version"] for package in packages if package["name"] == "mjplug"] == [PROJECT["version"]]
