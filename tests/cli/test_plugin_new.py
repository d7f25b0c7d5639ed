"""What `mjplug plugin new` writes, where nothing else is: it installs, passes its test, is listed, and runs."""

import subprocess

import pytest
from cli.process import Served, environment, run
from cli.test_wheel import environment_with, installed, pip, wheel  # noqa: F401  (fixtures)

from mjplug.client import connect

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def test_a_new_plugin_installs_passes_its_test_is_listed_and_runs(installed, tmp_path):  # noqa: F811
    command = [installed.with_name("mjplug")]
    written = run("plugin", "new", "street_lamp", cwd=tmp_path, command=command)
    assert written.returncode == 0, written.stderr
    folder = tmp_path / "street_lamp"
    pip(installed, "install", f"{folder}[test]")
    tested = subprocess.run(
        [installed, "-m", "pytest", "-q", str(folder)],
        cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120.0, check=False,
    )  # fmt: skip
    assert tested.returncode == 0, tested.stdout
    assert "2 passed" in tested.stdout
    listed = run("plugin", "list", cwd=tmp_path, command=command).stdout
    assert "street_lamp" in listed
    assert "Publishes the height of a body on `~/height` [m]" in listed
    server = Served("bundled:box", "--plugin", "street_lamp", cwd=tmp_path, command=command)
    try:
        with connect(server.endpoint) as client:
            assert client.subscribe("/street_lamp/height").next(10.0).data == pytest.approx(1.0)
    finally:
        assert server.stop() == 0
