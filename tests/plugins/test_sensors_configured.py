"""Which sensors there are by configuration, their noise, and what is refused."""

import logging

import mujoco
import numpy as np
import pytest

from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.testing import World
from mjplug_plugins.sensors import Sensors

ROBOT = """
<mujoco>
  <option gravity="0 0 0" timestep="0.002"/>
  <worldbody><body name="base"><freejoint/><geom size=".1"/>
    <body name="arm"><joint name="hinge"/><geom size=".1"/>
      <site name="torso" pos="0 0 .5"/><site name="wrist"/></body></body>
  </worldbody>
  <sensor>
    <gyro name="imu-torso-angular-velocity" site="torso" noise=".01"/>
    <accelerometer name="imu-torso-linear-acceleration" site="torso" noise=".2"/>
    <framequat name="torso_quat" objtype="site" objname="torso" noise=".05"/>
    <framepos name="torso_pos" objtype="site" objname="torso" noise=".1"/>
    <gyro name="torso_gyro" site="torso"/>
    <accelerometer name="torso_accel" site="torso"/>
    <force name="wrist_force" site="wrist"/>
    <user name="odd_torque" dim="3"/>
    <jointpos name="hinge_pos" joint="hinge"/>
    <magnetometer name="field" site="torso" noise="1e-6"/>
    <rangefinder name="eye" site="torso" noise=".01"/>
  </sensor>
</mujoco>
"""


def world_of(xml=ROBOT, seed=0, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    plugin, host = Sensors(), world.host("sensors", seed=seed)
    host.attach(plugin)
    plugin.init(host, Sensors.parameters_type(rate=500.0, **parameters))
    return world


def topics(world):
    return {name.removeprefix("/sensors/") for name in world.transport.publishers}


def xyz(vector):
    return np.array((vector.x, vector.y, vector.z))


def test_the_models_that_come_along_have_the_sensors_that_mujoco_ros2_control_finds_in_them():
    expected = {
        "quadruped": {"imu/imu", "base/pose", *(f"{leg}_foot_contact/touch" for leg in ("FL", "FR", "RL", "RR"))},
        "mobile_base": {"imu/imu", "base/pose"},
        "box": {"imu/imu", "box/pose"},
        "arm": {"body/pose", "body_magnetometer/magnetic_field", "wrist/wrench"},
    }
    for name, wanted in expected.items():
        world = World(load_model(f"bundled:{name}").model)
        world.add(Sensors, "sensors")
        world.loop.step(10)
        assert topics(world) == wanted
        for publisher in world.transport.publishers.values():
            assert publisher.messages


def test_parts_may_have_any_name():
    world = world_of(
        imu={
            "gyro": "imu-torso-angular-velocity", "accel": "imu-torso-linear-acceleration", "quat": "torso_quat",
            "topic": "/imu/data", "frame_id": "imu_link", "rate": 250.0,
            "orientation_covariance": [1.0, 2.0, 3.0],
            "angular_velocity_covariance": [float(i) for i in range(9)],
        }
    )  # fmt: skip
    world.data.qvel[:] = (0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0)
    world.loop.step(4)
    messages = world.published("/imu/data")
    assert [message.header.stamp.nanosec for message in messages] == [2_000_000, 6_000_000]
    assert messages[0].header.frame_id == "imu_link"
    assert messages[0].orientation_covariance == (1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0)
    assert messages[0].angular_velocity_covariance == tuple(float(i) for i in range(9))
    exact = world.data.sensor("imu-torso-angular-velocity").data
    assert xyz(messages[-1].angular_velocity) == pytest.approx(exact)


def test_one_name_in_the_model_may_be_several_sensors_each_with_its_own_settings():
    world = world_of(torso={"type": "imu", "topic": "/imu"}, base={"sensor": "torso", "type": "pose", "topic": "/pose"})
    assert set(world.transport.publishers) >= {"/imu", "/pose"}
    assert not {"torso/imu", "torso/pose"} & topics(world)


def test_a_sensor_can_be_left_out_and_nothing_need_be_found():
    assert topics(world_of(torso={"enabled": False})) == {
        "field/magnetic_field", "eye/range", "odd_torque/values",
    }  # fmt: skip
    assert topics(world_of(torso={"enabled": False, "type": "pose"}, field=None)) == {
        "torso/imu", "field/magnetic_field", "eye/range", "odd_torque/values",
    }  # fmt: skip
    assert topics(world_of(discover=[], hinge_pos={"type": "scalar"})) == {"hinge_pos/value"}


def test_a_sensor_that_lacks_a_part_is_named_once(caplog):
    with caplog.at_level(logging.WARNING):
        world_of()
    assert [record.getMessage() for record in caplog.records] == [
        "not published: fts 'wrist' needs a torque named wrist_torque"
    ]
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        world_of("<mujoco/>")
    assert "no sensor was found" in caplog.text


@pytest.mark.parametrize(
    ("parameters", "sentences"),
    [
        ({"wrist": {"type": "fts"}}, ["fts 'wrist': unknown torque 'wrist_torque'"]),
        (
            {"wrist": {"type": "fts", "torque": "odd_torque"}},
            ["fts 'wrist': 'odd_torque' has type user and 3 values, but a torque is required"],
        ),
        (
            {"torso": {"type": "imu", "gyro": "hinge_pos"}},
            ["imu 'torso': 'hinge_pos' has type jointpos and 1 value, but a gyro is required"],
        ),
        ({"hinge_pos": {"type": "vector"}}, ["a sensor with 3 values is required"]),
        ({"torso": {"rate": 5.0}}, ["sensor 'torso' can be pose or imu; set its `type`"]),
        ({"torsoo": {}}, ["unknown sensor 'torsoo', did you mean 'torso'?"]),
        ({"field": {"gyro": "torso_gyro"}}, ["sensor 'field' has type magnetometer, which has no parameter gyro"]),
        ({"torso": {"type": "pose", "min_range": 1.0}}, ["has type pose, which has no parameter min_range"]),
        (
            {"wrist": {"type": "fts"}, "lidar": {"type": "rangefinder"}, "x": {"type": "imu", "accel": "torso_acel"}},
            ["unknown torque", "unknown rangefinder 'lidar'", "unknown accelerometer 'torso_acel', did you mean"],
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_what_cannot_be_made_stops_the_start_with_all_reasons(parameters, sentences):
    with pytest.raises(MjplugError) as error:
        world_of(**parameters)
    for sentence in sentences:
        assert sentence in str(error.value)


def series(world, topic, field, *others):
    for name, publisher in world.transport.publishers.items():
        publisher.matched = name in (f"/sensors/{listened}" for listened in (topic, *others))
    world.loop.step(600)
    return np.array([field(message) for message in world.published(f"/sensors/{topic}")])


def test_without_asking_there_is_no_noise():
    world = world_of()
    positions = series(world, "torso/pose", lambda message: xyz(message.pose.position))
    assert np.array_equal(positions, [(0.0, 0.0, 0.5)] * 600)


def test_noise_has_the_standard_deviation_of_the_model_and_is_in_the_covariance():
    world = world_of(noise=True)
    others = ("field/magnetic_field", "eye/range")
    positions = series(world, "torso/pose", lambda message: xyz(message.pose.position), *others)
    assert positions.std(axis=0) == pytest.approx((0.1,) * 3, rel=0.1)
    assert positions.mean(axis=0) == pytest.approx((0.0, 0.0, 0.5), abs=0.015)
    turns = np.array(
        [
            (message.pose.orientation.w, *xyz(message.pose.orientation))
            for message in world.published("/sensors/torso/pose")
        ]
    )
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)
    assert (2.0 * np.arcsin(turns[:, 1:])).std(axis=0) == pytest.approx((0.05,) * 3, rel=0.1)
    fields = np.array([xyz(m.magnetic_field) for m in world.published("/sensors/field/magnetic_field")])
    # MuJoCo's usual field.
    assert fields.mean(axis=0) == pytest.approx((0.0, -0.5, 0.0), abs=1e-6)
    assert fields.std(axis=0) == pytest.approx((1e-6,) * 3, rel=0.1)
    covariance = world.published("/sensors/field/magnetic_field")[0].magnetic_field_covariance
    assert covariance == pytest.approx((1e-12, 0, 0, 0, 1e-12, 0, 0, 0, 1e-12), abs=1e-20)
    # Nothing is in reach, and noise makes nothing of it.
    assert all(message.range == np.inf for message in world.published("/sensors/eye/range"))


def test_noise_is_the_same_in_every_run_for_any_subscribers_and_another_for_another_seed():
    def positions(seed, *others):
        world = world_of(noise=True, seed=seed)
        return series(world, "torso/pose", lambda message: xyz(message.pose.position), *others)

    first = positions(1)
    assert np.array_equal(first, positions(1, "torso/imu", "field/magnetic_field"))
    assert not np.array_equal(first, positions(2))


def test_noise_makes_no_distance_of_what_is_beyond_the_cutoff():
    # A wall at 0.3 m along the site's z axis: in reach of one sensor, beyond the cutoff of the other.
    xml = ROBOT.replace(
        "<worldbody>", '<worldbody><geom name="wall" type="box" size=".1 .1 .1" pos="0 0 .9" contype="0"/>'
    ).replace(
        '<rangefinder name="eye" site="torso" noise=".01"/>',
        '<rangefinder name="eye" site="torso" noise=".01"/>'
        '<rangefinder name="short" site="torso" noise=".01" cutoff=".2"/>',
    )
    world = world_of(xml, noise=True, renamed={"sensor": "short"})
    seen = series(world, "eye/range", lambda message: message.range, "renamed/range")
    assert (seen.mean(), seen.std()) == (pytest.approx(0.3, abs=2e-3), pytest.approx(0.01, rel=0.1))
    beyond = world.published("/sensors/renamed/range")
    assert {message.range for message in beyond} == {np.inf}
    # Transforms uses the name of the sensor in the model.
    assert {message.header.frame_id for message in beyond} == {"short_frame"}


def test_noise_makes_no_negative_force_of_a_touch():
    world = world_of(ROBOT.replace("<sensor>", '<sensor><touch name="pad" site="wrist" noise=".5"/>'), noise=True)
    forces = series(world, "pad/touch", lambda message: message.data)
    assert forces.min() == 0.0
    # Half of the normal distribution is cut off.
    assert forces.mean() == pytest.approx(0.5 / np.sqrt(2.0 * np.pi), rel=0.15)


def test_noise_can_be_asked_for_one_sensor_only():
    world = world_of(base={"type": "pose", "sensor": "torso", "noise": True})
    positions = series(world, "base/pose", lambda message: xyz(message.pose.position), "field/magnetic_field")
    assert positions.std(axis=0) == pytest.approx((0.1,) * 3, rel=0.1)
    assert world.published("/sensors/field/magnetic_field")[0].magnetic_field_covariance == (0.0,) * 9
