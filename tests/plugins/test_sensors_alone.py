"""Sensors that are part of nothing: orientations, arrays of any size, sensors without a name, and spelled names."""

import logging

import mujoco
import numpy as np
import pytest

from mjplug.testing import World
from mjplug_plugins.sensors import Sensors
from mjplug_schemas.geometry_msgs import QuaternionStamped
from mjplug_schemas.names import validate_name
from mjplug_schemas.std_msgs import Float64MultiArray

ROBOT = """
<mujoco>
  <extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <camera name="overview" pos="0 -2 1" euler="60 0 0" resolution="64 48"/>
    <body name="base" pos="0 0 .3" euler="20 30 40"><freejoint/><geom type="box" size=".1 .2 .05" pos=".03 0 0"/>
      <site name="imu" euler="10 0 70"/>
      <body name="head" pos="0 0 .2" euler="0 50 0"><joint name="neck" type="ball"/><geom size=".06" pos=".05 0 0"/>
        <site name="eye"/></body></body>
    <body name="ball" pos="1 0 .055"><freejoint/><geom size=".06"/><site name="skin" size=".1"/></body>
  </worldbody>
  <sensor>
    <framequat name="imu_quat" objtype="site" objname="imu"/>
    <framequat name="in_base" objtype="site" objname="eye" reftype="xbody" refname="base"/>
    <framequat name="in_camera" objtype="site" objname="eye" reftype="camera" refname="overview"/>
    <ballquat name="neck_quat" joint="neck" noise=".01"/>
    <camprojection name="pixel" camera="overview" site="eye"/>
    <touch site="skin"/>
    <framequat objtype="body" objname="head"/>
    <plugin name="grid" plugin="mujoco.sensor.touch_grid" objtype="site" objname="skin">
      <config key="size" value="7 7"/><config key="fov" value="45 45"/><config key="gamma" value="0"/>
      <config key="nchannel" value="3"/></plugin>
  </sensor>
</mujoco>
"""


def world_of(xml=ROBOT, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    plugin, host = Sensors(), world.host("sensors")
    host.attach(plugin)
    plugin.init(host, Sensors.parameters_type(rate=500.0, **parameters))
    return world


def topics(world):
    return {name.removeprefix("/sensors/") for name in world.transport.publishers}


def matrix(quaternion):
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z]))
    return turn.reshape(3, 3)


def test_every_sensor_of_a_model_has_a_topic():
    expected = {
        "imu_quat/orientation", "in_base/orientation", "in_camera/orientation", "sensor_6/orientation",
        "neck_quat/values", "pixel/values", "sensor_5/touch", "grid/values",
    }  # fmt: skip
    assert topics(world_of()) == expected
    assert len(expected) == mujoco.MjModel.from_xml_string(ROBOT).nsensor


def test_an_orientation_is_that_of_the_object_in_the_frame_of_the_header():
    world = world_of()
    world.data.qvel[:] = np.linspace(-2, 2, world.model.nv)
    # The numbers are those of the beginning of the last step.
    world.loop.step(40)
    before = mujoco.MjData(world.model)
    before.qpos[:] = world.data.qpos
    mujoco.mj_forward(world.model, before)
    world.loop.step(1)

    def turn_of(name):
        return (before.site(name) if name in ("imu", "eye") else before.body(name)).xmat.reshape(3, 3)

    # ROS's optical frame has y down and z ahead.
    optical = before.cam("overview").xmat.reshape(3, 3) * (1, -1, -1)
    expected = {
        "imu_quat": ("world", turn_of("imu")),
        "in_base": ("base", turn_of("base").T @ turn_of("eye")),
        "in_camera": ("overview_frame", optical.T @ turn_of("eye")),
        "sensor_6": ("world", before.body("head").ximat.reshape(3, 3)),
    }
    for name, (frame, turn) in expected.items():
        message = world.published(f"/sensors/{name}/orientation")[-1]
        assert isinstance(message, QuaternionStamped)
        assert (message.header.frame_id, message.header.stamp.to_ns()) == (frame, 80_000_000)
        assert matrix(message.quaternion) == pytest.approx(turn, abs=1e-9), name


def test_an_array_has_the_numbers_of_its_sensor_in_mujoco_s_order():
    world = world_of()
    world.loop.step(100)
    for name, size in {"neck_quat": 4, "pixel": 2, "grid": 147}.items():
        message = world.published(f"/sensors/{name}/values")[-1]
        assert isinstance(message, Float64MultiArray)
        (dimension,) = message.layout.dim
        assert (dimension.size, dimension.stride, message.layout.data_offset) == (size, size, 0)
        assert message.data == tuple(world.data.sensor(name).data)
    assert any(world.published("/sensors/grid/values")[-1].data), "the ball presses on the floor"


def test_the_noise_of_a_ball_joint_is_a_turn_and_its_numbers_stay_a_unit_quaternion():
    world = world_of(noise=True)
    world.loop.step(50)
    noisy = np.array([message.data for message in world.published("/sensors/neck_quat/values")])
    assert np.linalg.norm(noisy, axis=1) == pytest.approx(1.0, abs=1e-9)
    assert 0.001 < np.abs(noisy[-1] - world.data.sensor("neck_quat").data).max() < 0.05


def test_a_sensor_without_a_name_is_configured_by_its_number():
    world = world_of(sensor_5={"topic": "/contact"}, sensor_6={"enabled": False})
    assert "/contact" in world.transport.publishers
    assert "sensor_6/orientation" not in topics(world)
    world.loop.step(100)
    forces = [message.data for message in world.published("/contact")]
    assert forces[-1] == world.data.sensordata[world.model.sensor_adr[5]]
    assert max(forces) > 0


UNITREE = """
<mujoco><worldbody><body name="pelvis"><freejoint/><geom size=".1"/><site name="imu"/></body></worldbody>
  <sensor>
    <framequat name="imu_quat" objtype="site" objname="imu"/>
    <gyro name="imu_gyro" site="imu"/>
    <accelerometer name="{}" site="imu"/>
    <framepos name="frame_pos" objtype="site" objname="imu"/>
  </sensor></mujoco>
"""


@pytest.mark.parametrize("name", ["imu_acc", "imu_accel"])
def test_an_accelerometer_of_an_imu_may_be_called_acc(name):
    world = world_of(UNITREE.format(name))
    assert topics(world) == {"imu/imu"}
    world.loop.step(10)
    message = world.published("/sensors/imu/imu")[-1]
    assert message.orientation_covariance[0] == 0, "its orientation is measured"
    assert message.linear_acceleration.z == pytest.approx(world.data.sensor(name).data[2], abs=1e-12)


def test_a_configured_imu_finds_its_accelerometer_by_either_ending():
    world = world_of(UNITREE.format("imu_acc"), body={"type": "imu", "sensor": "imu", "topic": "/imu"})
    assert set(world.transport.publishers) == {"/imu"}


def test_the_usual_ending_goes_before_the_other():
    both = UNITREE.format("imu_acc").replace("</sensor>", '<accelerometer name="imu_accel" site="imu"/></sensor>')
    world = world_of(both, discover=["imu", "vector"])
    assert topics(world) == {"imu/imu", "imu_acc/vector", "frame_pos/vector"}


def test_a_missing_part_is_named_with_the_right_article(caplog):
    with caplog.at_level(logging.WARNING):
        world_of(UNITREE.format("other"))
    assert "imu 'imu' needs an accelerometer named imu_accel or imu_acc" in caplog.text


def test_names_of_the_model_are_spelled_as_ros_allows(caplog):
    caplog.set_level(logging.INFO)
    names = ("left-foot", "left_foot", "left.foot", "3rd")
    touches = "".join(f'<touch name="{name}" site="skin"/>' for name in names)
    world = world_of(ROBOT.replace("</sensor>", f"{touches}</sensor>"), discover=["touch"])
    assert topics(world) == {
        f"{name}/touch" for name in ("left_foot", "left_foot_2", "left_foot_3", "_3rd", "sensor_5")
    }
    assert "'left-foot' -> left_foot_2, 'left.foot' -> left_foot_3, '3rd' -> _3rd" in caplog.text
    for name in world.transport.publishers:
        validate_name(name)
