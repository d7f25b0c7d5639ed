"""What pip makes of this repository: a wheel with the right things in it, which runs where nothing else is."""

import subprocess
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from cli.client import Client, wrench, wrenches
from cli.process import Served, run

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "mjplug": ROOT / "mjplug",
    "mjplug_plugins": ROOT / "plugins" / "mjplug_plugins",
    "mjplug_schemas": ROOT / "schemas" / "mjplug_schemas",
}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def pip(python, *arguments):
    command = [python, "-m", "pip", *arguments, "--quiet", "--disable-pip-version-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def environment(folder):
    """Makes a virtual environment with pip, which the one of the tests need not have, and returns its Python."""
    venv.create(folder, with_pip=True)
    return folder / "bin" / "python"


def environment_with(folder, *arguments):
    """Makes a virtual environment, installs something with pip, and returns its Python."""
    python = environment(folder)
    pip(python, "install", *arguments)
    return python


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pip(environment(tmp_path_factory.mktemp("builder")), "wheel", "--no-deps", "--wheel-dir", folder, ROOT)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    return environment_with(tmp_path_factory.mktemp("venv"), wheel)


def test_the_wheel_has_every_file_of_the_packages_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    expected = {
        f"{package}/{path.relative_to(folder).as_posix()}"
        for package, folder in PACKAGES.items()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    info = {name for name in names if name.partition("/")[0].endswith(".dist-info")}
    assert names - info == expected
    assert {f"{package}/py.typed" for package in PACKAGES} <= names
    assert {f"mjplug/bundled/{model}.xml" for model in ("arm", "box", "mobile_base", "quadruped")} <= names
    assert any(name.endswith("/licenses/LICENSE") for name in info)


def test_an_installed_server_runs_and_knows_its_plugins(installed, tmp_path):
    command = [installed.with_name("mjplug")]
    served = run(
        "serve", "bundled:box", "--duration", "1", "--speed", "max", "--listen", "tcp/127.0.0.1:0",
        "--plugin", "heartbeat", "--plugin", "mujoco_ros2_control_plugins/ExternalWrenchPlugin",
        cwd=tmp_path, command=command,
    )  # fmt: skip
    assert served.returncode == 0, served.stderr
    assert served.stdout.startswith("ready · tcp/127.0.0.1:")
    listed = run("plugin", "list", cwd=tmp_path, command=command)
    assert {"heartbeat", "external_wrench"} <= set(listed.stdout.split())


@pytest.mark.parametrize("model", ["arm", "box", "mobile_base", "quadruped"])
def test_an_installed_server_has_the_bundled_models(installed, tmp_path, model):
    checked = run("serve", f"bundled:{model}", "--check", cwd=tmp_path, command=[installed.with_name("mjplug")])
    assert checked.returncode == 0, checked.stderr


@pytest.fixture(scope="module")
def on_mujoco_4(wheel, tmp_path_factory):
    """An environment with MuJoCo 4.0.0, which the package's metadata excludes for an error in its solver."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    others = [one for one in project["dependencies"] if not one.startswith("mujoco")]
    tools = ["pytest", "pytest-timeout", "hypothesis"]
    python = environment_with(tmp_path_factory.mktemp("venv4"), "mujoco==4.0.0", *others, *tools)
    pip(python, "install", "--no-deps", wheel)
    return python


def test_the_server_runs_on_mujoco_4(on_mujoco_4, tmp_path):
    server = Served(
        "bundled:box", "--speed", "10", "--plugin", "heartbeat", "--plugin", "external_wrench",
        cwd=tmp_path, command=[on_mujoco_4, "-m", "mjplug"],
    )  # fmt: skip
    try:
        with Client(server.endpoint) as client:
            push = wrenches(wrench("box", force=(10.0, 0.0, 0.0), seconds=2.0, ramp=0.5))
            assert client.do("external_wrench/apply_wrench", **push) == "applied 1 wrench, the longest for 2 s"
            assert "Heartbeat #" in client.listen("mujoco_heartbeat/@json").next()["data"]
            client.do("mjplug/reset_world", keyframe="home")
        assert server.stop() == 0
    finally:
        server.kill()


def test_the_core_passes_its_tests_on_mujoco_4(on_mujoco_4):
    # By the script, so that the packages of the environment are tested and not those of this folder.
    command = [on_mujoco_4.with_name("pytest"), "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    plugins = [f"tests/plugins/test_{name}.py" for name in ("heartbeat", "external_wrench")]
    done = subprocess.run(
        [*command, "tests/physics", "tests/services", *plugins],
        cwd=ROOT, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-5000:]
