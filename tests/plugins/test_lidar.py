"""What a lidar publishes: values, order, time."""

import math
import textwrap

import mujoco
import numpy as np
import pytest

from mjplug.config.load import read
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.lidar import Lidar
from mjplug_schemas.sensor_msgs import LaserScan, PointCloud2, PointField

DT = 0.002

REFERENCE = """
/**:
  ros__parameters:
    mujoco_plugins:
      mujoco_3d_lidar_plugin:
        type: "mujoco_ros2_control_plugins/Mujoco3dLidarPlugin"
        2d_lidar:
          frame_name: "lidar_sensor_frame"
          topic: "/lidar_scan_2d"
        3d_lidar:
          frame_name: "3d_lidar_sensor_frame"
          topic: "/lidar_points_3d"
"""


def room(body='pos="1 -0.5 1"', site="", more=""):
    """Walls at x = ±4 and y = ±3, floor and ceiling at 0 and 3, and a ball that flies with a lidar in its middle."""
    return f"""
    <mujoco>
      <option timestep="{DT}" gravity="0 0 0"/>
      <worldbody>
        <geom type="plane" size="0 0 1"/><geom type="plane" size="0 0 1" pos="0 0 3" euler="180 0 0"/>
        <geom type="box" size=".1 3 3" pos="4.1 0 0"/><geom type="box" size=".1 3 3" pos="-4.1 0 0"/>
        <geom type="box" size="4 .1 3" pos="0 3.1 0"/><geom type="box" size="4 .1 3" pos="0 -3.1 0"/>
        <body name="carrier" {body}><freejoint/><geom size=".2"/><site name="eye" {site}/></body>
        {more}
      </worldbody>
    </mujoco>
    """


def lidar(columns=360, rows=1, **parameters):
    defaults = {
        "site": "eye",
        "resolution": (columns, rows),
        "azimuth_range": (-3.0, 3.0),
        "elevation_range": (-0.4, 0.4) if rows > 1 else (0.0,),
        "max_range": 100.0,
        "update_rate": 10.0,
    }
    return defaults | parameters


def world_of(xml, name="lidar", **parameters):
    model = xml if isinstance(xml, mujoco.MjModel) else mujoco.MjModel.from_xml_string(xml)
    world = World(model)
    world.add(Lidar, name, **parameters)
    return world


def points_of(cloud):
    return np.frombuffer(cloud.data, "<f4").reshape(cloud.height, cloud.width, 3)


def rays_now(world, azimuths, elevations, site="eye"):
    """Casts each ray alone, from the pose that the site has in the current state; the site's body is not seen."""
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_forward(world.model, data)
    geom = np.zeros(1, np.int32)
    body = int(world.model.site(site).bodyid[0])
    out = np.empty((len(elevations), len(azimuths)))
    for i, e in enumerate(elevations):
        for j, a in enumerate(azimuths):
            local = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
            ray = data.site(site).xmat.reshape(3, 3) @ local
            out[i, j] = mujoco.mj_ray(world.model, data, data.site(site).xpos, ray, None, True, body, geom)
    return np.where(out < 0, np.inf, out)


def test_a_scan_in_a_room_has_the_distances_to_the_walls():
    world = world_of(room(site='euler="0 0 25"'), scan=lidar(73, azimuth_range=(-math.pi, math.pi)))
    world.loop.step(50)
    (scan,) = world.published("/scan")
    angles = math.radians(25) + np.linspace(-math.pi, math.pi, 73)
    with np.errstate(divide="ignore"):
        along_x = np.where(np.cos(angles) > 0, 4.0 - 1.0, 4.0 + 1.0) / np.abs(np.cos(angles))
        along_y = np.where(np.sin(angles) > 0, 3.0 + 0.5, 3.0 - 0.5) / np.abs(np.sin(angles))
    assert np.allclose(scan.ranges, np.minimum(along_x, along_y), rtol=1e-6)


def test_the_points_of_a_cloud_lie_on_walls_floor_and_ceiling():
    world = world_of(room(), cloud=lidar(200, 40, elevation_range=(-1.2, 1.3), azimuth_range=(-3.1, 3.1)))
    world.loop.step(50)
    points = points_of(world.published("/points")[0]) + np.float32([1, -0.5, 1])
    overshoot = np.stack([np.abs(points[..., 0]) - 4, np.abs(points[..., 1]) - 3, np.abs(points[..., 2] - 1.5) - 1.5])
    assert np.abs(overshoot.max(axis=0)).max() < 1e-5
    assert all((np.abs(side) < 1e-5).sum() > 100 for side in overshoot)


def test_a_plane_at_an_angle_is_where_geometry_says():
    tilt = math.radians(20)
    xml = """<mujoco><worldbody><geom type="plane" size="0 0 1" pos="0 0 -1" euler="0 20 0"/>
    <site name="eye"/></worldbody></mujoco>"""
    world = world_of(xml, cloud=lidar(64, 16, elevation_range=(-1.5, -0.5)))
    world.loop.step(50)
    points = points_of(world.published("/points")[0]).astype(float)
    normal = np.array([math.sin(tilt), 0, math.cos(tilt)])
    assert np.isfinite(points).all()
    # The plane goes through (0, 0, -1).
    assert np.allclose(points @ normal, -math.cos(tilt), atol=2e-5)


def test_a_cloud_is_organised_with_rows_upwards_and_columns_to_the_left():
    world = world_of(room(site='euler="10 20 30"'), cloud=lidar(21, 5))
    world.loop.step(50)
    (cloud,) = world.published("/points")
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (21, 5, 12, 252)
    assert (cloud.is_dense, cloud.is_bigendian) == (False, False)
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        ("x", 0, PointField.FLOAT32, 1),
        ("y", 4, PointField.FLOAT32, 1),
        ("z", 8, PointField.FLOAT32, 1),
    ]
    x, y, z = np.moveaxis(points_of(cloud).astype(float), -1, 0)
    azimuths, elevations = np.linspace(-3, 3, 21), np.linspace(-0.4, 0.4, 5)
    assert np.allclose(np.arctan2(y, x), azimuths, atol=1e-6)
    assert np.allclose(np.arctan2(z, np.hypot(x, y)), elevations[:, None], atol=1e-6)
    assert np.allclose(np.sqrt(x**2 + y**2 + z**2), rays_now(world, azimuths, elevations), rtol=1e-6)


def test_a_message_belongs_to_the_state_of_its_stamp_while_the_sensor_moves():
    world = world_of(room(), scan=lidar(16), cloud=lidar(9, 4))
    world.data.qvel[:] = (2, 1, 0, 0.5, 0, 5)
    for k in range(1, 6):
        world.loop.step(50)
        scan, cloud = world.published("/scan")[-1], world.published("/points")[-1]
        assert scan.header.stamp == cloud.header.stamp
        assert scan.header.stamp.to_ns() == k * 100_000_000 == world.simulation.time_ns
        assert np.allclose(scan.ranges, rays_now(world, np.linspace(-3, 3, 16), [0.0])[0], rtol=1e-6)
        expected = rays_now(world, np.linspace(-3, 3, 9), np.linspace(-0.4, 0.4, 4))
        assert np.allclose(np.linalg.norm(points_of(cloud).astype(float), axis=-1), expected, rtol=1e-6)


def test_a_scan_says_how_it_was_made():
    world = world_of(room(), top=lidar(5, min_range=0.1, max_range=30.0, topic="scans", frame_name="laser"))
    world.loop.step(50)
    (scan,) = world.published("/lidar/scans")
    assert type(scan) is LaserScan
    assert scan.header.frame_id == "laser"
    assert (scan.angle_min, scan.angle_max, scan.angle_increment) == (-3.0, 3.0, 1.5)
    assert (scan.time_increment, scan.scan_time) == (0.0, np.float32(0.1))
    assert (scan.range_min, scan.range_max) == (np.float32(0.1), 30.0)
    assert len(scan.ranges) == 5
    assert scan.intensities == ()


def test_the_frame_is_the_site_s_name_unless_said():
    world = world_of(room(), scan=lidar(5))
    world.loop.step(50)
    assert world.published("/scan")[0].header.frame_id == "eye"


def test_one_row_looks_along_its_elevation():
    world = world_of(room(), scan=lidar(31, elevation_range=-0.6))
    world.loop.step(50)
    (scan,) = world.published("/scan")
    assert np.allclose(scan.ranges, rays_now(world, np.linspace(-3, 3, 31), [-0.6])[0], rtol=1e-6)
    # 1 m above the floor.
    assert min(scan.ranges) == pytest.approx(1 / math.sin(0.6))


def test_one_column_looks_along_the_first_azimuth():
    world = world_of(room(), scan=lidar(1, azimuth_range=(0.5, 1.0)), cloud=lidar(1, 7, azimuth_range=(0.5, 1.0)))
    world.loop.step(50)
    (scan,), (cloud,) = world.published("/scan"), world.published("/points")
    assert np.allclose(scan.ranges, rays_now(world, [0.5], [0.0])[0], rtol=1e-6)
    assert (scan.angle_min, scan.angle_max, scan.angle_increment) == (0.5, 0.5, 0.5)
    x, y, _ = points_of(cloud)[:, 0].T
    assert np.allclose(np.arctan2(y, x), 0.5)


def test_a_full_circle_has_its_seam_once_without_the_endpoint():
    both = lidar(8, azimuth_range=(-math.pi, math.pi))
    world = world_of(room(), a=both | {"topic": "/a"}, b=both | {"topic": "/b", "endpoint": False})
    world.loop.step(50)
    (a,), (b,) = world.published("/a"), world.published("/b")
    assert a.ranges[0] == pytest.approx(a.ranges[-1])
    assert (a.angle_max, a.angle_increment) == pytest.approx((math.pi, math.tau / 7))
    assert (b.angle_max, b.angle_increment) == pytest.approx((math.pi * 3 / 4, math.tau / 8))
    assert np.allclose(b.ranges, rays_now(world, -math.pi + math.tau / 8 * np.arange(8), [0.0])[0], rtol=1e-6)


def open_world(more=""):
    """A lidar at x = 0 without anything around but a box from x = 1 to x = 1.2, and one from y = 3 on."""
    return f"""<mujoco><option timestep="{DT}"/><worldbody><site name="eye"/>
    <geom type="box" size=".1 9 9" pos="1.1 0 0"/><geom type="box" size="9 .1 9" pos="0 3.1 0"/>{more}
    </worldbody></mujoco>"""


FOUR = {"azimuth_range": (-math.pi, math.pi / 2)}
"""Four rays: backwards, right, forward, left."""


def test_nothing_in_range_is_infinite_and_too_close_is_minus_infinite():
    world = world_of(open_world(), scan=lidar(4, **FOUR, min_range=2.0, max_range=4.0))
    world.loop.step(50)
    assert world.published("/scan")[0].ranges == pytest.approx((math.inf, math.inf, -math.inf, 3.0))


def test_what_is_beyond_the_range_is_nothing_even_if_mujoco_finds_it():
    world = world_of(open_world(), scan=lidar(4, **FOUR, max_range=2.9))
    world.loop.step(50)
    assert world.published("/scan")[0].ranges == pytest.approx((math.inf, math.inf, 1.0, math.inf))


def test_the_limits_of_the_range_are_in_it():
    world = world_of(open_world(), scan=lidar(4, **FOUR, min_range=1.0, max_range=3.0))
    world.loop.step(50)
    assert world.published("/scan")[0].ranges == pytest.approx((math.inf, math.inf, 1.0, 3.0))


def test_a_ray_without_a_distance_can_be_a_number():
    a, b = lidar(4, **FOUR, min_range=2.0, topic="/a"), lidar(4, **FOUR, min_range=2.0, topic="/b")
    world = world_of(open_world(), a=a | {"no_return": -1.0}, b=b | {"no_return": math.nan})
    world.loop.step(50)
    assert world.published("/a")[0].ranges == pytest.approx((-1.0, -1.0, -1.0, 3.0))
    assert np.isnan(world.published("/b")[0].ranges).tolist() == [True, True, True, False]


def test_points_without_a_distance_are_nan():
    world = world_of(open_world(), cloud=lidar(4, 2, **FOUR, elevation_range=(0.0, 0.1), min_range=2.0, max_range=4.0))
    world.loop.step(50)
    points = points_of(world.published("/points")[0])
    assert np.isnan(points[:, :3]).all()
    assert np.allclose(points[:, 3], [[0, 3, 0], [0, 3, 3 * math.tan(0.1)]], atol=1e-6)


@pytest.mark.parametrize("rate", [10.0, 15.0, 47.4, 90.3])
def test_the_rate_is_exact_in_the_mean(rate):
    world = world_of(room(), scan=lidar(1, update_rate=rate))
    world.loop.step(5000)
    stamps = [scan.header.stamp.to_ns() for scan in world.published("/scan")]
    assert len(stamps) == math.floor(10 * rate + 1e-9)
    ideal = np.arange(1, len(stamps) + 1) * 1e9 / rate
    late = np.array(stamps) - ideal
    assert late.min() > -1
    assert late.max() < DT * 1e9


def test_rate_0_is_every_step():
    world = world_of(room(), scan=lidar(1, update_rate=0))
    world.loop.step(7)
    scans = world.published("/scan")
    assert [scan.header.stamp.to_ns() for scan in scans] == [k * 2_000_000 for k in range(1, 8)]
    assert scans[0].scan_time == 0.0


def test_scans_continue_after_a_reset_with_the_state_put_back():
    world = world_of(room(), scan=lidar(9))
    first = rays_now(world, np.linspace(-3, 3, 9), [0.0])[0]
    world.data.qvel[0] = 3.0
    world.loop.step(130)
    world.loop.reset(Reset())
    world.loop.step(50)
    scans = world.published("/scan")
    assert [scan.header.stamp.to_ns() for scan in scans] == [100_000_000, 200_000_000, 360_000_000]
    assert not np.allclose(scans[1].ranges, first)
    assert np.allclose(scans[2].ranges, first, rtol=1e-6)


def test_only_lidars_with_subscribers_are_cast():
    world = world_of(room(), scan=lidar(4), cloud=lidar(4, 4))
    world.transport.publishers["/points"].matched = False
    world.loop.step(100)
    assert len(world.published("/scan")) == 2
    assert world.published("/points") == []
    world.transport.publishers["/scan"].matched = False
    world.loop.step(50)
    assert world.workers.workers["lidar"].status.performed == 2
    assert world.loop.scheduler.next_due > 1_000_000
    world.transport.publishers["/points"].matched = True
    world.transport.publishers["/points"].on_matched()
    world.loop.step(50)
    assert len(world.published("/points")) == 1


def test_lidars_of_one_rate_are_cast_from_one_state_in_one_job():
    world = world_of(room(), scan=lidar(4), cloud=lidar(4, 4), slow=lidar(2, topic="/slow", update_rate=5.0))
    world.loop.step(100)
    assert world.workers.workers["lidar"].status.performed == 3
    assert [len(world.published(topic)) for topic in ("/scan", "/points", "/slow")] == [2, 2, 1]


def test_a_busy_worker_gets_the_newest_state():
    world = world_of(room(), scan=lidar(4))
    world.data.qvel[0] = 1.0
    worker = world.workers.workers["lidar"]
    worker.hold()
    world.loop.step(150)
    worker.release()
    (scan,) = world.published("/scan")
    assert scan.header.stamp.to_ns() == 300_000_000
    assert np.allclose(scan.ranges, rays_now(world, np.linspace(-3, 3, 4), [0.0])[0], rtol=1e-6)
    assert worker.status.dropped == {"scan": 2}


def test_diagnostics_report_the_worker_and_the_duration_of_a_scan():
    world = world_of(room(), scan=lidar(4))
    world.loop.step(60)
    world.loop.step(1)
    diagnosis = world.diagnostics.diagnose()["lidar"]
    assert diagnosis.message == "running"
    assert diagnosis.values["jobs performed"] == "1"
    assert float(diagnosis.values["last scan of scan [ms]"]) > 0


def test_physics_waits_for_scans_only_if_asked_to():
    for sync in (False, True):
        assert world_of(room(), scan=lidar(4), sync=sync).workers.workers["lidar"].spec.sync is sync


def test_lost_work_is_reported_once(caplog):
    world = world_of(room(), scan=lidar(4))
    spec = world.workers.workers["lidar"].spec
    for _ in range(3):
        spec.on_lost(frozenset({"scan"}), "the process died")
    assert [r.getMessage() for r in caplog.records] == ["no scan of scan: the process died"]


SENSOR = """<plugin name="{name}" plugin="mujoco.plugin.lidar" objtype="site" objname="{site}">
  <config key="resolution" value="{resolution}"/><config key="azimuth_range" value="-3.14159 3.14159"/>
  <config key="elevation_range" value="{elevations}"/><config key="max_range" value="20"/>
  <config key="min_range" value="0.1"/>{more}</plugin>"""


@pytest.fixture
def reference_world(tmp_path):
    """A model and a parameter file as mujoco_ros2_control's users write them."""
    flat = SENSOR.format(name="2d_lidar", site="eye", resolution="90 1", elevations="0.2", more="")
    rate = '<config key="update_rate" value="20"/>'
    solid = SENSOR.format(name="3d_lidar", site="eye", resolution="32 8", elevations="-.2 .3", more=rate)
    sensors = f'<extension><plugin plugin="mujoco.plugin.lidar"/></extension><sensor>{flat}{solid}</sensor></mujoco>'
    (tmp_path / "room.xml").write_text(room().replace("</mujoco>", sensors))
    return World(load_model(str(tmp_path / "room.xml")).model)


def test_the_reference_s_model_and_parameters_work_unchanged(tmp_path, reference_world, caplog):
    (tmp_path / "plugins.yaml").write_text(textwrap.dedent(REFERENCE))
    _, (selected,) = select(read(tmp_path / "plugins.yaml", model="bundled:arm"))
    assert selected.plugin_class is Lidar
    world = reference_world
    Lidar().init(world.host(selected.name), selected.parameters)
    world.loop.step(500)
    flat, solid = world.published("/lidar_scan_2d"), world.published("/lidar_points_3d")
    # The extension's own default is 1 Hz.
    assert [scan.header.stamp.to_ns() for scan in flat] == [1_000_000_000]
    assert len(solid) == 20
    assert (type(flat[0]), type(solid[0])) == (LaserScan, PointCloud2)
    assert flat[0].header.frame_id == "lidar_sensor_frame"
    assert solid[0].header.frame_id == "3d_lidar_sensor_frame"
    angles = np.linspace(-3.14159, 3.14159, 90)
    assert np.allclose(flat[0].ranges, rays_now(world, angles, [0.2])[0], rtol=1e-6)
    assert (solid[0].width, solid[0].height) == (32, 8)
    assert not caplog.records


def test_without_parameters_the_lidars_of_a_model_publish_on_the_usual_topics(reference_world):
    reference_world.add(Lidar, "lidar")
    reference_world.loop.step(500)
    assert set(reference_world.transport.publishers) == {"/scan", "/points"}
    assert reference_world.published("/scan")[0].header.frame_id == "eye"
    assert len(reference_world.published("/points")) == 20
