"""A /dev/shm that is as small as a container's: everything works, and the server keeps nothing there."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from camera_scenes import gl  # noqa: F401 - a fixture
from cli.process import COMMAND, STARTING, Served, environment
from machine import lacking

from mjplug.client import connect

CROWD = Path(__file__).with_name("crowd.py")
CLIENTS = 6

MODEL = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/><geom type="plane" size="20 20 .1"/>
    <body name="robot" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .1 .1"/>
      <site name="eye" pos="0 0 .3"/></body>
    <body name="post" pos="2 0 1"><geom type="box" size=".1 .1 1"/></body>
    <camera name="overview" pos="0 -3 2" xyaxes="1 0 0 0 .5 .85" resolution="640 480"/>
  </worldbody>
</mujoco>
"""

CONFIG = """
model: model.xml
plugins:
  base_velocity: {type: base_velocity, body: robot}
  lidar:
    type: lidar
    front:
      {site: eye, topic: /scan, resolution: [360, 1], azimuth_range: [-3, 3], elevation_range: 0, max_range: 9}
  camera: {type: camera}
remap: {/base_velocity/cmd_vel: /cmd_vel}
"""


def in_small_shm(megabytes, *command):
    """Returns the command with a private /dev/shm of this size; skips the test if that is not possible."""
    script = f'mount -t tmpfs -o size={megabytes}m tmpfs /dev/shm && exec "$@"'
    wrapped = ("unshare", "--mount", "sh", "-c", script, "sh")
    try:
        subprocess.run([*wrapped, "true"], capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        lacking("this process may not mount a /dev/shm of its own")
    return (*wrapped, *command)


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("megabytes", [2, 64])
def test_a_server_its_workers_and_clients_work_with_a_small_dev_shm(tmp_path, megabytes):
    (tmp_path / "model.xml").write_text(MODEL)
    (tmp_path / "config.yaml").write_text(textwrap.dedent(CONFIG))
    server = Served("config.yaml", cwd=tmp_path, command=in_small_shm(megabytes, *COMMAND))
    crowd = None
    try:
        # In the server's own /dev/shm.
        inside = ("nsenter", f"--mount=/proc/{server.process.pid}/ns/mnt")
        crowd = subprocess.Popen(
            [*inside, sys.executable, str(CROWD), server.endpoint, str(CLIENTS)],
            env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert crowd.stdout.readline() == "put\n"
        with connect(server.endpoint, timeout=STARTING) as client:
            scan = client.subscribe("/scan")
            assert scan.next(STARTING).header.frame_id
            image = client.subscribe("/camera/overview/color").next(STARTING)
            assert (image.width, image.height, len(image.data)) == (640, 480, 640 * 480 * 3)
            assert len(set(bytes(image.data))) > 10, "something is drawn"
            assert client.call("~/set_pause", paused=False).message == "the simulation is already running"
        maps = Path(f"/proc/{server.process.pid}/maps").read_text()
        assert "/dev/shm" not in maps
        assert "Traceback" not in server.err.text
    finally:
        if crowd is not None:
            crowd.kill()
            crowd.communicate()
        code = server.stop() if server.running else None
        server.kill()
    assert code == 0
