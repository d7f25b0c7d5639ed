"""End to end: a model and a parameter file for mujoco_ros2_control are served, and a client subscribes."""

import math

import mujoco
import numpy as np
import pytest
from cli.client import Client
from cli.process import Served, run

from mjplug_schemas.sensor_msgs import PointCloud2

MODEL = """
<mujoco model="corridor">
  <extension><plugin plugin="mujoco.plugin.lidar"/></extension>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <geom type="plane" size="0 0 1"/><geom type="plane" size="0 0 1" pos="0 0 3" euler="180 0 0"/>
    <geom type="box" size="9 .1 2" pos="0 2.1 1"/><geom type="box" size="9 .1 2" pos="0 -2.1 1"/>
    <geom type="sphere" size=".5" pos="3 0 1" contype="0" conaffinity="0"/>
    <body name="cart" pos="0 0 1"><freejoint/><geom size=".2"/><site name="eye"/></body>
  </worldbody>
  <keyframe><key name="moving" qvel="1 0 0 0 0 0"/></keyframe>
  <sensor>
    <plugin name="flat" plugin="mujoco.plugin.lidar" objtype="site" objname="eye">
      <config key="resolution" value="64 1"/><config key="azimuth_range" value="-1 1"/>
      <config key="elevation_range" value="0"/><config key="max_range" value="20"/>
      <config key="update_rate" value="50"/></plugin>
    <plugin name="solid" plugin="mujoco.plugin.lidar" objtype="site" objname="eye">
      <config key="resolution" value="128 32"/><config key="azimuth_range" value="-3.14159 3.14159"/>
      <config key="elevation_range" value="-.5 .5"/><config key="max_range" value="20"/>
      <config key="update_rate" value="20"/></plugin>
  </sensor>
</mujoco>
"""

PARAMETERS = """
/**:
  ros__parameters:
    mujoco_plugins:
      mujoco_3d_lidar_plugin:
        type: "mujoco_ros2_control_plugins/Mujoco3dLidarPlugin"
        flat: {frame_name: laser, topic: /lidar_scan_2d}
        solid: {frame_name: laser_3d, topic: /lidar_points_3d}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corridor")
    (folder / "scene.xml").write_text(MODEL)
    (folder / "plugins.yaml").write_text(PARAMETERS)
    return folder


@pytest.fixture(scope="module")
def client(folder):
    server = Served("plugins.yaml", "--model", "scene.xml", "--set", "sim.keyframe=moving", cwd=folder)
    try:
        with Client(server.endpoint) as client:
            yield client
        assert server.stop() == 0
    finally:
        server.kill()


def at(message):
    return message["header"]["stamp"]["sec"] + message["header"]["stamp"]["nanosec"] / 1e9


def rays_at(time, azimuths, elevations):
    """Returns the distances of mj_ray at a time; the cart moves at 1 m/s along x."""
    xml = MODEL[: MODEL.index("<keyframe>")].replace('<plugin plugin="mujoco.plugin.lidar"/>', "") + "</mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[0] = time
    mujoco.mj_forward(model, data)
    geom, cart = np.zeros(1, np.int32), model.body("cart").id
    rays = [(math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)) for e in elevations for a in azimuths]
    found = [mujoco.mj_ray(model, data, data.site("eye").xpos, np.array(r), None, True, cart, geom) for r in rays]
    return np.array(found)


def test_scans_of_a_moving_cart_are_those_of_their_stamps(client):
    scans = client.listen("lidar_scan_2d/@json")
    for scan in (scans.next() for _ in range(5)):
        assert scan["header"]["frame_id"] == "laser"
        expected = rays_at(at(scan), np.linspace(-1, 1, 64), [0.0])
        assert np.allclose(np.array(scan["ranges"], float), np.where(expected < 0, np.inf, expected), rtol=1e-6)
        assert (at(scan) / 0.02) == pytest.approx(round(at(scan) / 0.02), abs=1e-6)


def test_clouds_of_a_moving_cart_are_those_of_their_stamps(client):
    clouds = client.listen("lidar_points_3d")
    for _ in range(3):
        cloud = PointCloud2.from_cdr(clouds.sample().payload.to_bytes())
        assert (cloud.width, cloud.height, cloud.header.frame_id) == (128, 32, "laser_3d")
        points = np.frombuffer(cloud.data, "<f4").reshape(-1, 3).astype(float)
        azimuths = np.linspace(-3.14159, 3.14159, 128)
        expected = rays_at(cloud.header.stamp.to_ns() / 1e9, azimuths, np.linspace(-0.5, 0.5, 32))
        expected = np.where((expected < 0) | (expected > 20), np.nan, expected)
        assert np.allclose(np.linalg.norm(points, axis=1), expected, rtol=2e-6, equal_nan=True)


def test_a_wrong_lidar_is_a_sentence_on_the_command_line(folder):
    (folder / "wrong.xml").write_text(MODEL.replace('value="64 1"', 'value="64 0"'))
    done = run("serve", "wrong.xml", "--check", cwd=folder)
    assert done.returncode != 0
    assert (
        f"{folder}/wrong.xml:13: lidar sensor 'flat': resolution is '64 0'; it must be two whole numbers above 0: "
        "columns and rows"
    ) in done.stderr
    assert "Traceback" not in done.stderr
