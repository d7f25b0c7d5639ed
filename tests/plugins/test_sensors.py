"""Sensors of the model as messages, against MuJoCo itself and against what is known without it."""

import math

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from mjplug.errors import MjplugError
from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.sensors import Sensors
from mjplug_schemas.sensor_msgs import Range

G = 9.81

BENCH = """
<mujoco>
  <option timestep="0.002" magnetic="2e-5 0 -4e-5"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="shelf" pos="0 0 1" euler="90 0 0">
      <geom type="box" size=".1 .1 .1" mass="1" contype="0" conaffinity="0"/>
      <site name="rest_site" pos=".05 0 0"/></body>
    <body name="stone" pos="1 0 10"><freejoint/><geom type="sphere" size=".1" mass="1"/>
      <site name="falling_site" pos="0 0 0"/></body>
    <body name="column" pos="2 0 1"><geom type="box" size=".05 .05 .05" mass="5" contype="0" conaffinity="0"/>
      <body name="tool"><joint name="locked" axis="0 1 0"/>
        <geom type="box" size=".05 .05 .05" pos=".3 0 0" mass="2" contype="0" conaffinity="0"/>
        <site name="wrist_site"/></body></body>
    <body name="spinner" pos="3 0 2"><joint name="spin" axis="0 0 1" damping="0"/>
      <geom type="sphere" size=".1" mass="1" pos=".5 0 0" contype="0" conaffinity="0"/>
      <site name="spinner_site" pos=".5 0 0"/></body>
    <body name="sonar" pos="4 0 .5"><site name="down" euler="180 0 0"/></body>
    <body name="box" pos="5 0 .0999"><freejoint/><geom name="box" type="box" size=".1 .1 .1" mass="3"/>
      <site name="pad" type="box" size=".11 .11 .11"/></body>
  </worldbody>
  <equality><weld body1="column" body2="tool"/></equality>
  <sensor>
    <framequat name="rest_quat" objtype="site" objname="rest_site"/>
    <gyro name="rest_gyro" site="rest_site"/>
    <accelerometer name="rest_accel" site="rest_site"/>
    <gyro name="falling_gyro" site="falling_site"/>
    <accelerometer name="falling_accel" site="falling_site"/>
    <force name="wrist_force" site="wrist_site"/>
    <torque name="wrist_torque" site="wrist_site"/>
    <framepos name="spinner_pos" objtype="site" objname="spinner_site"/>
    <framequat name="spinner_quat" objtype="site" objname="spinner_site"/>
    <gyro name="spinner_gyro" site="spinner_site"/>
    <accelerometer name="spinner_accel" site="spinner_site"/>
    <magnetometer name="compass" site="rest_site"/>
    <magnetometer name="turning_compass" site="spinner_site"/>
    <rangefinder name="altimeter" site="down" cutoff="3"/>
    <rangefinder name="scan-0" site="down"/>
    <touch name="foot" site="pad"/>
    <jointpos name="spin_pos" joint="spin"/>
    <velocimeter name="speed" site="spinner_site"/>
    <framelinvel name="tool_speed" objtype="site" objname="spinner_site" reftype="site" refname="rest_site"/>
  </sensor>
</mujoco>
"""


def world_of(xml=BENCH, rate=500.0, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.add(Sensors, "sensors", rate=rate, **parameters)
    return world


def last(world, topic):
    return world.published(f"/sensors/{topic}")[-1]


def xyz(vector):
    return np.array((vector.x, vector.y, vector.z))


def wxyz(quaternion):
    return np.array((quaternion.w, quaternion.x, quaternion.y, quaternion.z))


def seconds(message):
    return message.header.stamp.to_ns() / 1e9


def test_sensors_are_found_by_their_names_and_types():
    world = world_of()
    types = {name: type.TYPE for name, type in world.transport.types.items()}
    assert types == {
        "/sensors/rest/imu": "sensor_msgs/msg/Imu",
        "/sensors/falling/imu": "sensor_msgs/msg/Imu",
        "/sensors/spinner/imu": "sensor_msgs/msg/Imu",
        "/sensors/wrist/wrench": "geometry_msgs/msg/WrenchStamped",
        "/sensors/spinner/pose": "geometry_msgs/msg/PoseStamped",
        "/sensors/compass/magnetic_field": "sensor_msgs/msg/MagneticField",
        "/sensors/turning_compass/magnetic_field": "sensor_msgs/msg/MagneticField",
        "/sensors/altimeter/range": "sensor_msgs/msg/Range",
        "/sensors/foot/touch": "std_msgs/msg/Float64",
    }


def test_at_rest_an_accelerometer_reads_gravity_upwards_and_in_free_fall_nothing():
    world = world_of()
    world.loop.step(100)
    rest, falling = last(world, "rest/imu"), last(world, "falling/imu")
    # The shelf is turned on its side: its y axis points up.
    assert xyz(rest.linear_acceleration) == pytest.approx((0.0, G, 0.0), abs=1e-9)
    assert xyz(rest.angular_velocity) == pytest.approx((0.0, 0.0, 0.0))
    assert wxyz(rest.orientation) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    assert rest.header.frame_id == "rest_site"
    assert xyz(falling.linear_acceleration) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    # It measures no orientation, and the message marks this.
    assert falling.orientation_covariance[0] == -1.0
    assert rest.orientation_covariance == (0.0,) * 9


def test_a_turning_sensor_reads_the_centripetal_acceleration():
    world = world_of()
    world.data.qvel[world.model.joint("spin").dofadr[0]] = 3.0
    world.loop.step(50)
    imu = last(world, "spinner/imu")
    assert xyz(imu.angular_velocity) == pytest.approx((0.0, 0.0, 3.0), rel=1e-6)
    assert xyz(imu.linear_acceleration) == pytest.approx((-(3.0**2) * 0.5, 0.0, G), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("convention", "sign"), [("load", -1.0), ("mujoco", 1.0)])
def test_a_force_torque_sensor_reads_what_hangs_on_it(convention, sign):
    held = (
        BENCH.replace('<joint name="locked" axis="0 1 0"/>', "")
        .replace("<equality>", "<!--")
        .replace("</equality>", "-->")
    )
    world = world_of(held, fts_convention=convention)
    world.loop.step(10)
    wrench = last(world, "wrist/wrench").wrench
    assert xyz(wrench.force) == pytest.approx((0.0, 0.0, sign * 2.0 * G))
    # 2 kg at 0.3 m along x: the load turns about +y, from z towards x.
    assert xyz(wrench.torque) == pytest.approx((0.0, -sign * 2.0 * G * 0.3, 0.0))
    world.loop.step(1)
    assert last(world, "wrist/wrench").header.frame_id == "wrist_site"


def test_an_applied_force_and_torque_appear_in_the_axes_of_the_site():
    xml = BENCH.replace('<joint name="locked" axis="0 1 0"/>', "").replace("<equality>", "<!--").replace(
        "</equality>", "-->"
    ).replace('<site name="wrist_site"/>', '<site name="wrist_site" euler="0 0 90"/>')  # fmt: skip
    world = world_of(xml, fts_convention="load")
    world.loop.step(1)
    before = last(world, "wrist/wrench").wrench

    class Push:
        def update(self):
            world.data.xfrc_applied[world.model.body("tool").id] = (5.0, 0.0, 0.0, 0.0, 0.0, 7.0)

        def on_reset(self):
            pass

    push = Push()
    world.loop.steppers.add(push)
    world.loop.steppers.activate(push)
    world.loop.step(1)
    after = last(world, "wrist/wrench").wrench
    # The site's y axis is the world's -x, its x axis the world's y.
    assert xyz(after.force) - xyz(before.force) == pytest.approx((0.0, -5.0, 0.0), abs=1e-9)
    assert xyz(after.torque)[2] - xyz(before.torque)[2] == pytest.approx(7.0)


def test_a_magnetometer_reads_the_field_in_its_own_axes():
    world = world_of()
    world.data.joint("spin").qpos[0] = math.pi / 2
    world.loop.step(1)
    # Turned by a quarter about x: the world's -z is the sensor's -y.
    assert xyz(last(world, "compass/magnetic_field").magnetic_field) == pytest.approx((2e-5, -4e-5, 0.0))
    # Turned by a quarter about z: the world's x is the sensor's -y.
    assert xyz(last(world, "turning_compass/magnetic_field").magnetic_field) == pytest.approx((0.0, -2e-5, -4e-5))


def test_the_model_may_have_its_field_in_another_unit():
    world = world_of(field_scale=1e-4, turning_compass={"field_scale": 2.0})
    world.loop.step(1)
    assert xyz(last(world, "compass/magnetic_field").magnetic_field) == pytest.approx((2e-9, -4e-9, 0.0))
    assert xyz(last(world, "turning_compass/magnetic_field").magnetic_field) == pytest.approx((4e-5, 0.0, -8e-5))


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
def test_all_values_are_those_of_the_stamp_exactly(integrator):
    xml = BENCH.replace("<option ", f'<option integrator="{integrator}" ')
    world = world_of(xml, discover=["imu", "pose", "scalar", "vector"])
    world.data.joint("spin").qvel[0] = 4.0
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.joint("spin").qvel[0] = 4.0
    for k in range(100):
        # Independently: the sensors of the state before the step, and its time.
        mujoco.mj_forward(model, data)
        expected = {name: data.sensor(name).data.copy() for name in ("spinner_gyro", "spinner_pos", "speed")}
        world.loop.step(1)
        imu, pose, speed = (last(world, topic) for topic in ("spinner/imu", "spinner/pose", "speed/vector"))
        for message in (imu, pose, speed):
            assert message.header.stamp.to_ns() == 2_000_000 * k
        assert xyz(imu.angular_velocity) == pytest.approx(expected["spinner_gyro"], rel=1e-12)
        assert xyz(pose.pose.position) == pytest.approx(expected["spinner_pos"], rel=1e-12)
        assert xyz(speed.vector) == pytest.approx(expected["speed"], rel=1e-9)
        angle = data.joint("spin").qpos[0]
        # And the pose by hand.
        assert xyz(pose.pose.position) == pytest.approx((3 + 0.5 * math.cos(angle), 0.5 * math.sin(angle), 2.0))
        assert wxyz(pose.pose.orientation) == pytest.approx((math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)))
        mujoco.mj_step(model, data)
    assert last(world, "spinner/pose").header.frame_id == "world"


def test_after_a_forward_the_stamp_is_that_of_the_new_state():
    world = world_of()
    host = world.host("other")
    host.create_timer(0.002, host.forward)
    assert host.sensor_time_ns == 0
    world.loop.step(5)
    assert host.sensor_time_ns == host.time_ns == 10_000_000


def test_stamps_never_go_back_at_a_reset():
    world = world_of()
    world.loop.step(10)
    world.loop.reset(Reset())
    world.loop.step(10)
    stamps = [seconds(message) for message in world.published("/sensors/rest/imu")]
    assert stamps == pytest.approx([0.002 * k for k in range(20)])


def test_subscribing_does_not_change_what_the_robot_does():
    ends = []
    for matched in (True, False):
        world = world_of()
        for publisher in world.transport.publishers.values():
            publisher.matched = matched
        world.loop.step(300)
        ends.append(world.data.qpos.copy())
    assert np.array_equal(*ends)


def test_a_rangefinder_reads_the_distance_along_its_x_axis_and_infinity_beyond_its_reach():
    world = world_of(altimeter={"min_range": 0.2, "field_of_view": 0.1, "radiation": "ultrasound"})
    world.loop.step(1)
    message = last(world, "altimeter/range")
    assert message.range == pytest.approx(0.5)
    assert (message.min_range, message.max_range) == (pytest.approx(0.2), 3.0)
    assert (message.radiation_type, message.field_of_view) == (Range.ULTRASOUND, pytest.approx(0.1))
    assert message.header.frame_id == "altimeter_frame"
    for height, expected in ((0.1, -math.inf), (3.5, math.inf)):
        low = world_of(BENCH.replace('"4 0 .5"', f'"4 0 {height}"'), altimeter={"min_range": 0.2})
        low.loop.step(1)
        assert last(low, "altimeter/range").range == expected
    nothing = world_of(BENCH.replace('<site name="down" euler="180 0 0"/>', '<site name="down"/>'))
    nothing.loop.step(1)
    assert last(nothing, "altimeter/range").range == math.inf


def test_a_touch_sensor_reads_the_weight():
    world = world_of()
    world.loop.step(500)
    assert last(world, "foot/touch").data == pytest.approx(3.0 * G, rel=1e-3)


def test_any_other_sensor_is_a_number_or_a_vector_in_its_frame():
    world = world_of(discover=["scalar", "vector"])
    assert set(world.transport.publishers) == {
        "/sensors/spin_pos/value", "/sensors/speed/vector", "/sensors/tool_speed/vector",
        # No parts of a sensor, as only these kinds are asked for.
        *(f"/sensors/{name}/vector" for name in (
            "rest_gyro", "rest_accel", "falling_gyro", "falling_accel", "wrist_force", "wrist_torque", "spinner_pos",
            "spinner_gyro", "spinner_accel")),
    }  # fmt: skip
    world.data.joint("spin").qvel[0] = 4.0
    world.loop.step(100)
    assert last(world, "spin_pos/value").data == pytest.approx(4.0 * 99 * 0.002)
    speed, relative = last(world, "speed/vector"), last(world, "tool_speed/vector")
    assert (speed.header.frame_id, relative.header.frame_id) == ("spinner_site", "rest_site")
    assert xyz(speed.vector) == pytest.approx((0.0, 2.0, 0.0), abs=1e-9)


def test_only_messages_with_subscribers_are_built():
    world = world_of()
    for publisher in world.transport.publishers.values():
        publisher.matched = False
    world.loop.step(10)
    assert world.loop.scheduler.next_due > world.simulation.step + 1000
    chosen = world.transport.publishers["/sensors/rest/imu"]
    chosen.matched = True
    chosen.on_matched()
    world.loop.step(10)
    assert [name for name, publisher in world.transport.publishers.items() if publisher.messages] == [
        "/sensors/rest/imu"
    ]
    assert len(chosen.messages) == 10


def test_wrong_numbers_are_refused():
    for wrong in ({"rate": 0.0}, {"rest": {"orientation_covariance": [1.0, 2.0]}}, {"rest": 5}, {"discover": ["gps"]}):
        with pytest.raises(ValidationError):
            Sensors.parameters_type(**wrong)
    with pytest.raises(MjplugError, match="have the same topic"):
        world_of(rest={"topic": "/imu"}, falling={"topic": "/imu"})
