"""How the command line imports MuJoCo: quickly, and so that a plugin can still render in the server's process."""

import sys

import pytest
from camera_scenes import gl  # noqa: F401 - a fixture

RENDER = """
import os
from mjplug.cli.engine import import_mujoco
import_mujoco()
import mujoco
assert os.environ["MUJOCO_GL"] == {backend!r}
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 24, 32) as renderer:
    renderer.update_scene(data)
    print(renderer.render().shape, mujoco.GLContext.__module__)
"""


def test_a_server_imports_no_window_library_and_no_opengl(cli):
    done = cli("serve", "bundled:box", "--check", command=[sys.executable, "-X", "importtime", "-m", "mjplug"])
    assert done.returncode == 0
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "mujoco" in imported
    assert not imported & {"glfw", "OpenGL", "mujoco.glfw", "mujoco.egl"}


@pytest.mark.usefixtures("gl")
def test_a_plugin_that_renders_in_the_server_s_process_gets_the_backend_that_was_chosen(cli):
    done = cli("-c", RENDER.format(backend="egl"), command=[sys.executable], env={"MUJOCO_GL": "egl"})
    assert (done.returncode, done.stdout) == (0, "(24, 32, 3) mujoco.egl\n"), done.stderr


def test_disabled_rendering_stays_disabled(cli):
    done = cli("-c", RENDER.format(backend="disable"), command=[sys.executable], env={"MUJOCO_GL": "disable"})
    assert done.returncode == 1
    assert "AttributeError: module 'mujoco' has no attribute 'GLContext'" in done.stderr


def test_importing_again_asks_for_no_backend(cli):
    twice = "from mjplug.cli.engine import import_mujoco\nimport_mujoco()\nimport_mujoco()"
    done = cli("-c", twice, command=[sys.executable], env={"MUJOCO_GL": "crayons"})
    assert (done.returncode, done.stderr) == (0, "")
