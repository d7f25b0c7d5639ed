"""Libraries with plugins of the MuJoCo engine: loaded before the model, and in worker processes too."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from mjplug.config.load import load
from mjplug.config.problem import ConfigError

LIFT = """
#include <mujoco/mujoco.h>
static int nstate(const mjModel* m, int instance) { return 0; }
static int init(const mjModel* m, mjData* d, int instance) { return 0; }
static void reset(const mjModel* m, mjtNum* state, void* data, int instance) {}
static void compute(const mjModel* m, mjData* d, int instance, int capability) { d->qfrc_passive[2] += 3.0; }
mjPLUGIN_LIB_INIT(lift) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "mjplug.test.lift";
  plugin.capabilityflags |= mjPLUGIN_PASSIVE;
  plugin.nstate = nstate;
  plugin.init = init;
  plugin.reset = reset;
  plugin.compute = compute;
  mjp_registerPlugin(&plugin);
}
"""

MODEL = """
<mujoco><option gravity="0 0 0" timestep="0.01"/>
  <extension><plugin plugin="mjplug.test.lift"/></extension>
  <worldbody><body name="ball"><freejoint/><geom size=".1" mass="2"/><plugin plugin="mjplug.test.lift"/>
    <site name="eye"/></body></worldbody></mujoco>
"""

CONFIG = """
model: ball.xml
sim: {plugin_libraries: [libs/liblift.so], speed: max}
plugins:
  laser:
    type: lidar
    sync: true
    scan: {site: eye, resolution: 4, azimuth_range: [-1, 1], elevation_range: 0, max_range: 5, update_rate: 10}
"""

SCRIPT = """
import mjplug

with mjplug.open_server("robot.yaml", run=False) as server:
    with server.client() as client, client.subscribe("/scan") as scans:
        server.step(100)
        print("scan", len(scans.next(timeout=60.0).ranges))
    print("height", float(server.data.qpos[2]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model that needs a library, the library, and a configuration."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    package = Path(mujoco.__file__).parent
    libraries = sorted(package.glob("libmujoco.so*"))
    if compiler is None or not libraries or not (package / "include").is_dir():
        pytest.skip("needs Linux, a C compiler and MuJoCo's headers")
    folder = tmp_path_factory.mktemp("lift")
    (folder / "libs").mkdir()
    (folder / "lift.c").write_text(LIFT)
    subprocess.run(
        [
            *(compiler, "-shared", "-fPIC", "-I", package / "include", "-o", folder / "libs" / "liblift.so"),
            *(folder / "lift.c", libraries[0], f"-Wl,-rpath,{package}"),
        ],
        check=True,
    )
    (folder / "ball.xml").write_text(MODEL)
    (folder / "robot.yaml").write_text(CONFIG)
    return folder


def check(folder, *arguments):
    command = [sys.executable, "-m", "mjplug", "serve", *arguments, "--check"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=60)


def test_a_model_that_needs_a_library_is_served_with_it_in_worker_processes_too(folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "scan 4" in done.stdout
    # 3 N on 2 kg for 100 steps of 0.01 s, integrated as MuJoCo does: the velocity first.
    height = float(re.search(r"height (\S+)", done.stdout)[1])
    assert height == pytest.approx(1.5 * 0.01**2 * 100 * 101 / 2, rel=1e-9)


def test_without_the_library_the_model_is_refused(folder):
    done = check(folder, "ball.xml")
    assert done.returncode == 4
    assert "mjplug.test.lift" in done.stderr


def test_a_file_that_is_no_library_is_refused_with_its_place(folder, tmp_path):
    (tmp_path / "ball.xml").write_text(MODEL)
    (tmp_path / "text.so").write_text("no library")
    (tmp_path / "c.yaml").write_text("model: ball.xml\nsim:\n  plugin_libraries: [text.so]\n")
    done = check(tmp_path, "c.yaml")
    assert done.returncode == 3
    assert "c.yaml:3:22: error: sim.plugin_libraries[0]: " in done.stderr
    assert "text.so cannot be loaded as a plugin library of MuJoCo: " in done.stderr
    assert "Traceback" not in done.stderr


def test_a_library_that_is_not_there_is_refused_with_its_place(tmp_path):
    (tmp_path / "c.yaml").write_text("model: a.xml\nsim: {plugin_libraries: [none.so]}\n")
    with pytest.raises(ConfigError) as refused:
        load(tmp_path / "c.yaml", environ={})
    assert "c.yaml:2:26: error: sim.plugin_libraries[0]: there is no file 'none.so' in " in str(refused.value)
