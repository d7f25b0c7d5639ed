"""Saved states and digests of a server with cameras and lidars in worker processes."""

import numpy as np
import pytest
from camera_scenes import gl  # noqa: F401 - a fixture

from mjplug_schemas.geometry_msgs import Twist

SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.004" integrator="implicitfast"/>
  <visual><quality shadowsize="256"/></visual>
  <worldbody>
    <light pos="0 0 4"/>
    <geom type="plane" size="9 9 .1"/>
    <geom type="box" size=".1 2 .5" pos="3 0 .5"/>
    <camera name="eye" pos="0 -4 2" xyaxes="1 0 0 0 .4 1"/>
    <body name="base" pos="0 0 .12"><freejoint/>
      <geom type="box" size=".25 .15 .05" mass="8"/><geom type="sphere" size=".05" pos="-.2 0 -.07" friction="0"/>
      <geom type="sphere" size=".05" pos=".2 0 -.07" friction="0"/>
      <site name="front" pos=".26 0 .05" xyaxes="0 0 -1 0 1 0"/><site name="scanner" pos="0 0 .1"/>
      <body name="left" pos="0 .2 -.02"><joint name="left_wheel" axis="0 1 0"/>
        <geom type="cylinder" size=".1 .02" zaxis="0 1 0" mass=".5"/></body>
      <body name="right" pos="0 -.2 -.02"><joint name="right_wheel" axis="0 1 0"/>
        <geom type="cylinder" size=".1 .02" zaxis="0 1 0" mass=".5"/></body>
    </body>
    <body name="ball" pos=".8 0 .6"><freejoint/><geom size=".1" mass=".3"/></body>
  </worldbody>
  <actuator>
    <velocity name="left_drive" joint="left_wheel" kv="5"/><velocity name="right_drive" joint="right_wheel" kv="5"/>
  </actuator>
  <sensor><rangefinder name="bumper-0" site="front"/></sensor>
</mujoco>
"""

PLUGINS = {
    "drive": {"type": "diff_drive", "wheel_radius": 0.1, "wheel_separation": 0.4, "cmd_timeout": 0.9},
    "ranges": {
        "type": "rangefinder_lidar",
        "lidar_publish_rate": 40.0,
        "bumper": {
            "frame_name": "front", "min_angle": 0.0, "max_angle": 0.0, "angle_increment": 0.1,
            "laserscan_topic": "/ranges",
        },
    },
    "description": "robot_description",
    "scan": {
        "type": "lidar",
        "sync": True,
        "around": {
            "site": "scanner", "resolution": [24, 1], "azimuth_range": [-3.0, 3.0], "elevation_range": [0.0],
            "max_range": 9.0, "update_rate": 30.0, "noise_std": 0.02, "dropout": 0.1,
        },
    },
    "camera": {"type": "camera", "sync": True, "width": 32, "height": 24, "camera_publish_rate": 12.0},
}  # fmt: skip


def driven(server, chunks=12):
    """Drives the base, steps in chunks; returns the samples of all topics at each boundary, and the digest."""
    local, samples = server.local, []
    command = {"/cmd_vel": Twist.model_validate({"linear": {"x": 0.5}, "angular": {"z": 0.3}})}
    for number in range(chunks):
        result = local.step(9, inputs=command if number == 4 else None, outputs=topics_of(server))
        samples.append([(sample.topic, sample.fresh, bytes(sample.cdr)) for sample in result.samples])
    return samples, local.call("~/get_state_digest").digest


def topics_of(server):
    listed = server.client().topics()
    return sorted(
        name
        for name, topic in listed.items()
        if topic.type in ("sensor_msgs/msg/Image", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2")
        and topic.publishers
    )


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
def test_images_and_scans_after_a_restore_are_those_after_the_save(mjplug_server, tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE)
    options = {"plugins": PLUGINS, "run": False, "settings": {"snapshots.folder": str(tmp_path)}}
    server = mjplug_server(tmp_path / "scene.xml", **options)
    local = server.local
    local.step(0, inputs={"/cmd_vel": {"linear": {"x": 0.8}}})
    local.step(97)
    assert server.data.ncon > 1
    assert local.save("here", file=True).left_out == ()
    expected = driven(server)
    names = {topic for topic, _, _ in expected[0][0]}
    assert {"/camera/eye/color", "/camera/eye/depth"} < names
    assert len(names) >= 4
    images = {content for row in expected[0] for topic, _, content in row if topic == "/camera/eye/color"}
    assert len(images) == len(expected[0]), "every image is another one"
    local.step(33)
    local.restore("here", file=True, strict=True)
    assert driven(server) == expected
    other = mjplug_server(tmp_path / "scene.xml", **options)
    other.local.restore("here", file=True, strict=True)
    assert driven(other) == expected


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
@pytest.mark.timeout(400)
def test_ten_thousand_steps_give_the_same_state_with_and_without_cameras(mjplug_server, tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE)
    controls = np.random.default_rng(3).uniform(-8.0, 8.0, (200, 2))

    def run(chunk, watched, **changes):
        plugins = {**PLUGINS, **changes}
        server = mjplug_server(tmp_path / "scene.xml", plugins={k: v for k, v in plugins.items() if v}, run=False)
        subscriptions = []
        if watched:
            client = server.client()
            subscriptions = [client.subscribe(topic, bytes, depth=5) for topic in topics_of(server)]
        for rows in np.split(controls, chunk):
            server.local.rollout(rows, n=50)
        for subscription in subscriptions:
            subscription.next(timeout=60.0)
        digest = server.local.call("~/get_state_digest")
        server.stop()
        assert digest.step == 10_000
        return digest.digest

    expected = run(1, False, camera=None, scan=None)
    asynchronous = {**PLUGINS["camera"], "sync": False}
    assert run(200, False) == expected
    assert run(10, True) == expected
    assert run(10, True, camera=asynchronous) == expected
