"""The help texts of the command line."""

import sys
import textwrap
from importlib.metadata import version

import pytest


def test_help_names_the_commands_and_the_exit_codes(cli):
    shown = cli("--help")
    assert shown.returncode == 0
    for text in (
        "serve",
        "plugin",
        "Examples:\n    mjplug serve bundled:arm --plugin heartbeat ",
        "Exit codes: 0 ok, 1 failed, 2 usage, 3 configuration, 4 model, 5 network,",
        "6 timeout, 7 refused by the server, 40 stop forced, 130 Ctrl-C, 143 SIGTERM.",
    ):
        assert text in shown.stdout


def test_help_of_serve_has_examples_and_every_option_and_imports_neither_mujoco_nor_zenoh(cli):
    shown = cli("serve", "--help", command=[sys.executable, "-X", "importtime", "-m", "mjplug"])
    assert shown.returncode == 0
    for text in (
        "mjplug serve config.yaml", "mjplug serve bundled:quadruped --keyframe home", "MJPLUG_SIM__SPEED=2",
        "--model", "--paused", "--keyframe", "--speed", "--listen", "--connect", "--plugin", "--set", "--duration",
        "--check", "--verbose", "--quiet",
    ):  # fmt: skip
        assert text in shown.stdout, text
    imported = {line.rpartition("|")[2].strip() for line in shown.stderr.splitlines() if line.startswith("import time")}
    assert "mjplug.cli.app" in imported
    assert not imported & {"mujoco", "zenoh", "numpy", "cv2"}


@pytest.mark.parametrize(
    "words", [("--help",), ("topic", "--help"), ("topic", "echo", "--help"), ("service", "call", "-h")]
)
def test_help_imports_nothing_slow(cli, words):
    shown = cli(*words, command=[sys.executable, "-X", "importtime", "-m", "mjplug"])
    assert shown.returncode == 0
    assert shown.stdout.startswith("Usage: ")
    imported = {line.rpartition("|")[2].strip() for line in shown.stderr.splitlines() if line.startswith("import time")}
    assert "mjplug.cli.app" in imported
    heavy = {"mujoco", "zenoh", "numpy", "cv2", "rich.console", "yaml", "mjplug_schemas.message"}
    assert not imported & heavy


def test_the_version_is_that_of_the_package(cli):
    shown = cli("--version")
    assert (shown.returncode, shown.stdout) == (0, f"mjplug {version('mjplug')}\n")


def test_the_list_of_plugins_has_their_names_what_they_do_and_what_the_reference_calls_them(cli):
    listed = cli("plugin", "list")
    assert listed.returncode == 0
    for text in (
        "heartbeat ", "external_wrench ", "Applies external wrenches to bodies",
        "mujoco_ros2_control_plugins/HeartbeatPublisherPlugin", "mujoco_ros2_control_plugins/ExternalWrenchPlugin",
    ):  # fmt: skip
        assert text in listed.stdout, text


def test_the_page_of_a_plugin_has_its_parameters_with_type_default_and_unit(cli):
    shown = cli("plugin", "info", "mujoco_ros2_control_plugins/ExternalWrenchPlugin")
    assert shown.returncode == 0
    assert "force_arrow_scale (number, default 0.01)\n      Arrow length per unit force [m/N]." in shown.stdout
    assert "type: mujoco_ros2_control_plugins/ExternalWrenchPlugin\n      force_arrow_scale: 0.01\n" in shown.stdout


def test_what_the_page_of_a_plugin_suggests_for_a_file_is_valid(cli, tmp_path):
    shown = cli("plugin", "info", "heartbeat").stdout
    suggested = textwrap.dedent(shown.partition("configuration file:")[2].lstrip("\n"))
    (tmp_path / "config.yaml").write_text(f"model: bundled:box\n{suggested}")
    checked = cli("serve", "config.yaml", "--check")
    assert checked.returncode == 0, checked.stderr
    assert "plugins: heartbeat" in checked.stdout


def install(folder, name, module, entry):
    """Puts a package with one plugin into a folder, as pip would."""
    (folder / f"{name}.py").write_text(module)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[mjplug.plugins]\n{entry}\n")


PLUGIN = '''
from mjplug.plugin import Host, Parameters, Plugin

class Lamp(Plugin[Parameters]):
    """Shines."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.logger.info("the lamp is on")
'''


def test_plugins_of_other_packages_are_listed_and_those_that_cannot_be_imported_do_not_hide_others(cli, tmp_path):
    install(tmp_path, "lamps", PLUGIN, "lamp = lamps:Lamp")
    install(tmp_path, "bare", PLUGIN.replace('"""Shines."""', ""), "undocumented = bare:Lamp")
    install(tmp_path, "missing", "import nothing_of_this_name", "missing = missing:Lamp")
    install(tmp_path, "invalid", "def (", "invalid = invalid:Lamp")
    install(tmp_path, "unlucky", "raise RuntimeError('no power')", "unlucky = unlucky:Lamp")
    listed = cli("plugin", "list", env={"PYTHONPATH": str(tmp_path)})
    assert listed.returncode == 0, listed.stderr
    for text in ("heartbeat ", "Shines.", "bare:Lamp", "missing:Lamp", "invalid:Lamp", "unlucky:Lamp"):
        assert text in listed.stdout, text


def test_a_plugin_of_another_package_runs_by_its_name(cli, tmp_path):
    install(tmp_path, "lamps", PLUGIN, "lamp = lamps:Lamp")
    checked = cli("serve", "bundled:box", "--plugin", "lamp", "--check", env={"PYTHONPATH": str(tmp_path)})
    assert checked.returncode == 0, checked.stderr
    assert "lamp: the lamp is on" in checked.stderr
