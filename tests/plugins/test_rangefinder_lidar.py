import logging
import math
import textwrap

import mujoco
import numpy as np
import pytest

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.rangefinder_lidar import LidarParameters, RangefinderLidar

DT = 0.002

DEMO = """\
/**:
  ros__parameters:
    mujoco_plugins:
      rangefinder_lidar_plugin:
        type: "mujoco_ros2_control_plugins/RangefinderLidarPlugin"
        lidar_publish_rate: 5.0
        lidar:
          frame_name: lidar_sensor_frame
          min_angle: -0.3
          max_angle: 0.3
          angle_increment: 0.025
          range_min: 0.05
          range_max: 10.0
          laserscan_topic: /scan
"""


def lidar(count=5, start=0.0, increment=0.5, **others):
    angles = {"min_angle": start, "max_angle": start + (count - 1) * increment, "angle_increment": increment}
    return {"frame_name": "laser", **angles, **others}


def rays(count=5, start=0.0, increment=0.5, name="lidar-{}", first=0, attributes=""):
    """Sites and sensors of a lidar in the xy plane of its body."""
    sites, sensors = "", ""
    for i in range(count):
        angle, ray = start + i * increment, name.format(first + i)
        sites += f'<site name="{ray}" zaxis="{math.cos(angle)!r} {math.sin(angle)!r} 0"/>'
        sensors += f'<rangefinder name="{ray}" site="{ray}" {attributes}/>'
    return sites, sensors


def room(*lidars, body='pos="1 -0.5 1" euler="0 0 25"', others=""):
    """A room from -4 to 4 in x and from -3 to 3 in y; the lidars are on a free body, without gravity."""
    sites, sensors = ("".join(part) for part in zip(*lidars, strict=True)) if lidars else ("", "")
    return f"""
    <mujoco>
      <option timestep="{DT}" gravity="0 0 0"/>
      <worldbody>
        <geom type="box" size=".1 3 2" pos="4.1 0 0"/><geom type="box" size=".1 3 2" pos="-4.1 0 0"/>
        <geom type="box" size="4 .1 2" pos="0 3.1 0"/><geom type="box" size="4 .1 2" pos="0 -3.1 0"/>
        <body name="carrier" {body}><freejoint/><geom size=".2"/>{sites}</body>
        {others}
      </worldbody>
      <sensor>{sensors}</sensor>
    </mujoco>
    """


def world_of(xml, name="scanner", **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.add(RangefinderLidar, name, **parameters)
    return world


def scans(world, topic="/scan"):
    return world.published(topic)


def sensors_now(world, names):
    """Returns the values of MuJoCo's sensors in the current state."""
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_forward(world.model, data)
    return np.array([data.sensor(name).data[0] for name in names])


def test_in_a_room_the_ranges_are_the_distances_to_the_walls():
    world = world_of(room(rays(73, -math.pi, math.tau / 72)), lidar=lidar(73, -math.pi, math.tau / 72))
    world.loop.step(100)
    (scan,) = scans(world)
    angles = math.radians(25) - math.pi + math.tau / 72 * np.arange(73)
    with np.errstate(divide="ignore"):
        along_x = np.where(np.cos(angles) > 0, 4.0 - 1.0, 4.0 + 1.0) / np.abs(np.cos(angles))
        along_y = np.where(np.sin(angles) > 0, 3.0 + 0.5, 3.0 - 0.5) / np.abs(np.sin(angles))
    assert np.allclose(scan.ranges, np.minimum(along_x, along_y), rtol=1e-6)


def test_a_scan_belongs_to_the_state_of_its_stamp_not_to_the_step_before():
    world = world_of(room(rays(8, 0, 0.7)), lidar=lidar(8, 0, 0.7), lidar_publish_rate=50.0)
    names = [f"lidar-{i}" for i in range(8)]
    world.data.qvel[:] = (2, 1, 0, 0, 0, 5)
    for k in range(1, 6):
        world.loop.step(10)
        scan = scans(world)[-1]
        assert scan.header.stamp.to_ns() == k * 20_000_000 == world.simulation.time_ns
        assert np.array_equal(np.float32(scan.ranges), np.float32(sensors_now(world, names)))


def test_mujoco_s_own_values_would_be_one_step_old():
    """Guards the test above: there, the difference is seen."""
    world = world_of(room(rays(8, 0, 0.7)), lidar=lidar(8, 0, 0.7))
    world.data.qvel[:] = (2, 1, 0, 0, 0, 5)
    world.loop.step(10)
    names = [f"lidar-{i}" for i in range(8)]
    assert np.abs(world.data.sensordata - sensors_now(world, names)).min() > 1e-4


def test_the_message_contains_the_configured_values():
    parameters = lidar(5, -1.0, 0.5, range_min=0.1, range_max=30, frame_name="laser_frame", laserscan_topic="scans")
    world = world_of(room(rays(5, -1.0)), lidar=parameters, lidar_publish_rate=4)
    world.loop.step(125)
    (scan,) = scans(world, "/scanner/scans")
    assert scan.header.frame_id == "laser_frame"
    assert scan.header.stamp.to_ns() == 250_000_000
    assert (scan.angle_min, scan.angle_max, scan.angle_increment) == (-1.0, 1.0, 0.5)
    assert (scan.time_increment, scan.scan_time) == (0.0, 0.25)
    assert (scan.range_min, scan.range_max) == (np.float32(0.1), 30.0)
    assert len(scan.ranges) == 5
    assert scan.intensities == ()


def test_nothing_in_range_is_infinite_and_too_close_is_minus_infinite():
    """Four rays: at a wall 3 m away, at a wall 3.5 m away, at a box 0.05 m away, through the open ceiling."""
    sites = "".join(
        f'<site name="lidar-{i}" pos="{pos}" zaxis="{z}"/>'
        for i, (pos, z) in enumerate(
            [("0 0 0", "1 0 0"), ("0 0 0", "0 1 0"), ("-.5 0 0", "-1 0 0"), ("0 0 0", "0 0 1")]
        )
    )
    sensors = "".join(f'<rangefinder name="lidar-{i}" site="lidar-{i}"/>' for i in range(4))
    box = '<geom type="box" size=".1 .1 .1" pos=".35 -.5 1"/>'
    world = world_of(
        room((sites, sensors), body='pos="1 -0.5 1"', others=box), lidar=lidar(4, range_min=0.1, range_max=3.2)
    )
    world.loop.step(100)
    (scan,) = scans(world)
    assert scan.ranges == pytest.approx((3.0, math.inf, -math.inf, math.inf))


def test_returns_beyond_a_sensor_s_cutoff_are_infinite():
    world = world_of(room(rays(4, 0, math.pi / 2, attributes='cutoff="3.2"'), body='pos="1 -.5 1"'), lidar=lidar(4))
    world.loop.step(100)
    (scan,) = scans(world)
    assert scan.ranges == pytest.approx((3.0, math.inf, math.inf, 2.5))


@pytest.mark.parametrize(
    ("low", "high", "increment", "count"),
    [
        (-0.3, 0.3, 0.025, 25),
        (0.0, 0.3, 0.1, 4),
        (0.0, 1.0, 0.25, 5),
        (0.0, 1.0, 0.3, 4),
        (-3.14159, 3.14159, 0.0174533, 361),
        (-1.5707963, 1.5707963, 0.0087266, 361),
        (1.0, -1.0, -0.5, 5),
        (0.4, 0.4, 0.1, 1),
    ],
)
def test_the_last_ray_is_counted_in_spite_of_rounding(low, high, increment, count):
    parameters = LidarParameters(frame_name="laser", min_angle=low, max_angle=high, angle_increment=increment)
    assert parameters.rays == count


def test_all_25_rays_come_out_where_the_division_makes_24(caplog):
    world = world_of(
        room(rays(25, -0.3, 0.025)),
        lidar={"frame_name": "laser", "min_angle": -0.3, "max_angle": 0.3, "angle_increment": 0.025},
    )
    world.loop.step(100)
    (scan,) = scans(world)
    assert np.array_equal(np.float32(scan.ranges), np.float32(sensors_now(world, [f"lidar-{i}" for i in range(25)])))
    assert scan.angle_max == pytest.approx(scan.angle_min + 24 * scan.angle_increment)
    assert not caplog.records


def test_angle_max_is_the_angle_of_the_last_ray():
    world = world_of(room(rays(4, 0.0, 0.3)), lidar=lidar(4, 0.0, 0.3) | {"max_angle": 1.0})
    world.loop.step(100)
    (scan,) = scans(world)
    assert len(scan.ranges) == 4
    assert scan.angle_max == pytest.approx(0.9)


def refusal(xml, **parameters):
    with pytest.raises(MjplugError) as caught:
        world_of(xml, **parameters)
    return str(caught.value)


def test_missing_rays_are_refused_by_name():
    some = rays(3), rays(2, first=5)
    assert refusal(room(*some), lidar=lidar(8)) == (
        "lidar 'lidar' has 8 rays according to its angles, but the model has no rangefinder named lidar-3, lidar-4, "
        "lidar-7"
    )


def test_one_missing_ray_at_the_end_is_refused_where_no_rounding_explains_it():
    assert refusal(room(rays(4)), lidar=lidar(5)) == (
        "lidar 'lidar' has 5 rays according to its angles, but the model has no rangefinder named lidar-4"
    )
    one_gone = rays(12, -0.3, 0.025), rays(12, -0.3, 0.025, first=13)
    angles = {"frame_name": "laser", "min_angle": -0.3, "max_angle": 0.3, "angle_increment": 0.025}
    assert refusal(room(*one_gone), lidar=angles) == (
        "lidar 'lidar' has 25 rays according to its angles, but the model has no rangefinder named lidar-12"
    )


def test_very_many_missing_rays_are_not_all_named():
    parameters = {"frame_name": "laser", "min_angle": 0, "max_angle": 1, "angle_increment": 1e-12}
    sentence = refusal(room(rays(2)), lidar=parameters)
    assert sentence.startswith(
        "lidar 'lidar' has 1000000000001 rays according to its angles, but the model has no rangefinder"
    )
    assert sentence.endswith("lidar-20, lidar-21, … (999999999999 in all)")


def test_rays_beyond_the_last_angle_are_left_out_and_reported(caplog):
    world = world_of(room(rays(9)), lidar=lidar(5))
    world.loop.step(100)
    assert len(scans(world)[0].ranges) == 5
    assert [r.getMessage() for r in caplog.records] == [
        "lidar 'lidar': 4 rays, from lidar-5 on, are beyond max_angle and are not published"
    ]


@pytest.mark.parametrize("name", ["lidar-{:03}", "front-left-{}", "2d_lidar-{}"])
def test_the_number_stands_after_the_last_dash_with_or_without_zeros(name):
    group = name.rpartition("-")[0]
    world = world_of(room(rays(12, name=name)), **{group: lidar(12)})
    world.loop.step(100)
    names = [name.format(i) for i in range(12)]
    assert np.array_equal(np.float32(scans(world)[0].ranges), np.float32(sensors_now(world, names)))


def test_rays_may_stand_in_any_order_and_between_other_sensors():
    (first_site, first), (second_site, second) = rays(1, first=0), rays(1, start=2.0, first=1)
    gyro = '<gyro name="lidar-2" site="lidar-0"/><rangefinder site="lidar-0"/><rangefinder name="up" site="lidar-0"/>'
    world = world_of(room((first_site + second_site, second + gyro + first)), lidar=lidar(2))
    world.loop.step(100)
    assert scans(world)[0].ranges == pytest.approx(sensors_now(world, ["lidar-0", "lidar-1"]))


def test_two_sensors_with_one_number_are_refused():
    doubled = rays(2), rays(1, name="lidar-0{}", first=1)
    assert refusal(room(*doubled), lidar=lidar(2)) == (
        "rangefinders 'lidar-1' and 'lidar-01' are both ray 1 of lidar 'lidar'"
    )


def test_a_rangefinder_of_a_camera_is_no_ray():
    sites, sensors = rays(1)
    camera = '<camera name="eye" resolution="4 3"/>', '<rangefinder name="lidar-1" camera="eye"/>'
    assert refusal(room((sites, sensors), camera), lidar=lidar(2)) == "ray 1 of lidar 'lidar' is not attached to a site"


def test_an_unknown_lidar_is_refused_with_the_known_ones():
    assert refusal(room(rays(5), rays(5, name="rear-{}")), lida=lidar()) == (
        "unknown rangefinder lidar 'lida', did you mean 'lidar'?; known: lidar, rear"
    )
    assert refusal(room(), lidar=lidar()) == "unknown rangefinder lidar 'lidar'; there is no rangefinder lidar"


def test_without_parameters_for_any_lidar_the_plugin_refuses():
    assert refusal(room(rays(5), rays(5, name="rear-{}"))) == (
        "no lidar is configured; set frame_name, min_angle, max_angle and angle_increment under the name of one of: "
        "lidar, rear"
    )


def test_a_model_without_lidars_is_reported(caplog):
    world_of(room())
    assert [r.getMessage() for r in caplog.records] == [
        "the model has no rangefinder named <lidar>-<number>: nothing is published"
    ]


def test_lidars_without_parameters_are_left_out_and_reported(caplog):
    world = world_of(room(rays(5), rays(5, name="rear-{}"), rays(5, name="top-{}")), lidar=lidar())
    assert set(world.transport.publishers) == {"/scan"}
    assert [r.getMessage() for r in caplog.records] == [
        "not published, because no parameters are set for them: rear, top"
    ]


def test_two_lidars_publish_on_their_own_topics_at_the_same_instants():
    world = world_of(
        room(rays(5), rays(3, 1.0, name="rear-{}")),
        lidar=lidar(laserscan_topic="/front"),
        rear=lidar(3, 1.0, laserscan_topic="/rear", frame_name="rear_frame"),
        lidar_publish_rate=70,
    )
    world.loop.step(5000)
    front, rear = scans(world, "/front"), scans(world, "/rear")
    assert len(front) == 700
    assert [s.header.stamp for s in front] == [s.header.stamp for s in rear]
    assert {len(s.ranges) for s in rear} == {3}
    assert {s.header.frame_id for s in rear} == {"rear_frame"}


def test_the_default_rate_is_5_hz_and_a_reset_restarts_its_phase():
    world = world_of(room(rays(5)), lidar=lidar())
    world.loop.step(150)
    world.loop.reset(Reset())
    world.loop.step(200)
    assert [s.header.stamp.to_ns() for s in scans(world)] == [200_000_000, 500_000_000, 700_000_000]


def test_nothing_is_cast_without_subscribers():
    world = world_of(room(rays(5)), lidar=lidar())
    world.transport.publishers["/scan"].matched = False
    world.loop.step(500)
    assert scans(world) == []
    assert world.loop.scheduler.next_due > 1_000_000


def selected_of(tmp_path, text):
    (tmp_path / "plugins.yaml").write_text(textwrap.dedent(text))
    _, (selected,) = select(read(tmp_path / "plugins.yaml", model="bundled:arm"))
    return selected


def test_the_demo_s_configuration_and_model_load_unchanged(tmp_path, caplog):
    """The model has the 24 rays that truncation leaves of 25; what is published agrees with itself."""
    selected = selected_of(tmp_path, DEMO)
    assert selected.plugin_class is RangefinderLidar
    world = World(load_model("bundled:arm").model, keyframe="start_90")
    plugin, host = RangefinderLidar(), world.host(selected.name)
    plugin.init(host, selected.parameters)
    assert [(r.levelno, r.getMessage()) for r in caplog.records] == [
        (
            logging.WARNING,
            "lidar 'lidar': the model has no ray 24 at max_angle = 0.3, so the scan ends at 0.275; the model was "
            "probably generated with (max_angle - min_angle) / angle_increment truncated",
        )
    ]
    world.loop.step(400)
    scan = scans(world)[-1]
    assert scan.header.frame_id == "lidar_sensor_frame"
    assert len(scan.ranges) == 24
    assert (scan.angle_min, scan.angle_max) == (np.float32(-0.3), np.float32(0.275))
    assert (scan.range_min, scan.range_max, scan.scan_time) == (np.float32(0.05), 10.0, np.float32(0.2))
    expected = sensors_now(world, [f"lidar-{i:02}" for i in range(24)])
    assert np.isfinite(scan.ranges).sum() > 20
    assert np.array_equal(np.float32(scan.ranges), np.float32(np.where(expected < 0, np.inf, expected)))


WRONG = [
    (("max_angle: 0.3\n", "max_angel: 0.3\n"), 10, "lidar.max_angel: unknown key; known: angle_increment, "),
    (("max_angle: 0.3\n", "max_angel: 0.3\n"), 7, "lidar.max_angle: required, but not given"),
    (("angle_increment: 0.025", "angle_increment: 0"), 11, "lidar.angle_increment: angle_increment must not be 0"),
    (
        ("angle_increment: 0.025", "angle_increment: -0.1"),
        11,
        "lidar.angle_increment: -0.1 has the wrong sign: min_angle is -0.3 and max_angle is 0.3",
    ),
    (
        ("angle_increment: 0.025", "angle_increment: 1e-310"),
        11,
        "lidar.angle_increment: 1e-310 is too small: the number of rays is not finite",
    ),
    (("range_min: 0.05", "range_min: 10"), 13, "lidar.range_max: range_max (10) must be above range_min (10)"),
    (
        ("range_min: 0.05\n          range_max: 10.0", "range_min: 2000"),
        8,
        "lidar: range_max (1000) must be above range_min (2000)",
    ),
    (("range_min: 0.05", "range_min: -1"), 12, "lidar.range_min: Input should be greater than or equal to 0, not -1"),
    (("range_max: 10.0", "range_max: .inf"), 13, "lidar.range_max: Input should be a finite number, not inf"),
    (("frame_name: lidar_sensor_frame", "frame_name: 5"), 8, "lidar.frame_name: Input should be text, not 5"),
    (("lidar_publish_rate", "lidar_publish_rat"), 6, "lidar_publish_rat: unknown key; known: lidar_publish_rate"),
    (("publish_rate: 5.0", "publish_rate: 0"), 6, "lidar_publish_rate: Input should be greater than 0, not 0"),
    (("lidar:\n", "lidar: [1]\n        other:\n"), 7, "lidar: Input should be a mapping, not a list"),
]


@pytest.mark.parametrize(("change", "line", "sentence"), WRONG, ids=[w[2] for w in WRONG])
def test_a_wrong_parameter_is_reported_in_its_place(tmp_path, change, line, sentence):
    assert change[0] in DEMO
    with pytest.raises(ConfigError) as caught:
        selected_of(tmp_path, DEMO.replace(*change))
    found = [(p.mark.line, p.message.removeprefix("plugins.rangefinder_lidar_plugin.")) for p in caught.value.problems]
    assert any(at == line and message.startswith(sentence) for at, message in found), found
