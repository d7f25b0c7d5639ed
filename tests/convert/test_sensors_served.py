"""Sensors of a URDF, end to end: converted, served, and read over the wire, against values computed by hand."""

import math

import numpy as np
import pytest
from camera_scenes import gl  # noqa: F401 - a fixture
from cli.process import Served

from convert.robots import BOX, joint, link, robot, rotation
from mjplug.client import connect

GRAVITY, TOOL = 9.81, 0.5
ROOM = {"x": (-3.0, 2.0), "y": (-2.5, 1.5)}
"""Inner surfaces of the walls."""

LIDAR, LIDAR_YAW = (0.2, 0.1, 0.4), 0.3
EYE, EYE_YAW = (0.0, 0.0, 0.5), 0.0
IMU_ROLL = 0.4


def wall(name, axis, side, rgba):
    at = ROOM[axis][side] + (0.05 if side else -0.05)
    size, pos = ("0.05 5 2", f"{at} 0 0") if axis == "x" else ("5 0.05 2", f"0 {at} 0")
    return f'<geom name="{name}" type="box" size="{size}" pos="{pos}" rgba="{rgba}"/>'


SCENE = (
    '<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual><worldbody>'
    + wall("ahead", "x", 1, "0 1 0 1") + wall("behind", "x", 0, "1 1 1 1")
    + wall("left", "y", 1, "1 0 0 1") + wall("right", "y", 0, "0 0 1 1") + "</worldbody></mujoco>"
)  # fmt: skip


def scan(low, high, count):
    return (
        f"<scan><horizontal><samples>{count}</samples><min_angle>{low}</min_angle><max_angle>{high}</max_angle>"
        "</horizontal></scan><range><min>0.1</min><max>12</max></range>"
    )


def sensor(reference, name, kind, rest):
    return f'<gazebo reference="{reference}"><sensor name="{name}" type="{kind}">{rest}</sensor></gazebo>'


URDF = robot(
    link("world", 0),
    link("base", 5.0, shape=BOX),
    joint("mount", "world", "base", "fixed"),
    link("tool", TOOL, at="0.1 0 0"),
    joint("wrist", "base", "tool", "fixed", xyz="0 0 -0.5", rpy="0 0 0.7"),
    link("eye_optical", 0),
    joint("eye_joint", "base", "eye_optical", "fixed", xyz="0 0 0.5", rpy="-1.5707963267948966 0 -1.5707963267948966"),
    link("scanner", 0),
    joint("scanner_joint", "base", "scanner", "fixed", xyz="0.2 0.1 0.4", rpy="0 0 0.3"),
    sensor("base", "imu", "imu", f"<pose>0 0 0.1 {IMU_ROLL} 0 0</pose><update_rate>50</update_rate>"),
    sensor("wrist", "load", "force_torque", "<update_rate>50</update_rate>"),
    sensor("base", "camera", "camera",
        "<pose>0 0 0.5 0 0 0</pose><update_rate>5</update_rate><camera><horizontal_fov>1.2</horizontal_fov>"
        "<image><width>64</width><height>48</height></image></camera>"),
    sensor("scanner", "around", "gpu_lidar", f"<topic>scan</topic><lidar>{scan(-1.5, 1.5, 61)}</lidar>"),
    sensor("base", "turned", "ray",
        f"<pose>0.2 0.1 0.4 0 0 0.3</pose><ray>{scan(0, 6.28, 360)}</ray><update_rate>5</update_rate>"),
    '<ros2_control name="s" type="system"><joint name="j"><command_interface name="position"/></joint>'
    '<sensor name="imu2"><state_interface name="orientation.x"/><param name="frame_id">tool</param></sensor>'
    "</ros2_control>"
    "<mujoco_inputs><raw_inputs><sensor><rangefinder name='beams' site='beams'/></sensor></raw_inputs>"
    "<processed_inputs>"
    "<camera site='eye_optical' name='eye' fovy='50' resolution='40 30'/>"
    "<lidar ref_site='scanner' sensor_name='beams' min_angle='-0.5' max_angle='0.5' angle_increment='0.1'/>"
    "</processed_inputs></mujoco_inputs>",
    link("arm", 0.2), joint("j", "base", "arm", xyz="0 0 -0.2"),
    name="sensing",
)  # fmt: skip


def distance(angle):
    """Returns the distance from the lidar to the wall, at an angle in the lidar's frame."""
    direction = np.array([math.cos(angle + LIDAR_YAW), math.sin(angle + LIDAR_YAW)])
    found = []
    for axis, part, start in zip("xy", direction, LIDAR, strict=False):
        if abs(part) > 1e-12:
            found.append((ROOM[axis][int(part > 0.0)] - start) / part)
    return min(found)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensing")
    (folder / "walls.xml").write_text(SCENE)
    (folder / "sensing.urdf").write_text(URDF)
    environ = {"XDG_CACHE_HOME": str(folder / "cache")}
    server = Served("sensing.urdf", "--scene", "walls.xml", cwd=folder, env=environ)
    try:
        with connect(server.endpoint) as client:
            yield client
    finally:
        server.kill()


def settled(client, topic, after=1.0):
    """Returns the first message of a topic from a simulated second on."""
    client.wait_for(topic, timeout=60.0)
    messages = client.subscribe(topic)
    while True:
        message = messages.next(timeout=60.0)
        if message.header.stamp.sec >= after:
            return message


def test_an_imu_at_rest_measures_gravity_upwards_in_its_own_frame(client):
    message = settled(client, "/sensors/imu/imu")
    measured = message.linear_acceleration
    wanted = rotation((IMU_ROLL, 0, 0)).T @ (0, 0, GRAVITY)
    assert [measured.x, measured.y, measured.z] == pytest.approx(wanted.tolist(), abs=1e-6)
    assert message.header.frame_id == "imu"
    assert (message.orientation.x, message.orientation.w) == pytest.approx(
        (math.sin(IMU_ROLL / 2), math.cos(IMU_ROLL / 2)), abs=1e-9
    )
    other = settled(client, "/sensors/imu2/imu")
    assert other.header.frame_id == "tool"
    assert other.linear_acceleration.z == pytest.approx(GRAVITY, abs=1e-6)
    assert other.orientation.z == pytest.approx(math.sin(0.35), abs=1e-9)


def test_a_force_torque_sensor_measures_the_load(client):
    message = settled(client, "/sensors/load/wrench")
    force, torque = message.wrench.force, message.wrench.torque
    assert message.header.frame_id == "tool"
    assert [force.x, force.y, force.z] == pytest.approx([0, 0, -TOOL * GRAVITY], abs=1e-6)
    # The lever is 0.1 m along x of the tool: x cross -z is y.
    assert [torque.x, torque.y, torque.z] == pytest.approx([0, 0.1 * TOOL * GRAVITY, 0], abs=1e-6)


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize(("name", "size", "focal"), [("camera", (64, 48), 32 / math.tan(0.6)), ("eye", (40, 30), None)])
def test_cameras_see_what_is_ahead_with_the_right_size_and_calibration(client, name, size, focal):
    info = settled(client, f"/camera/{name}/camera_info")
    focal = focal or size[1] / 2 / math.tan(math.radians(25))
    assert (info.width, info.height) == size
    assert [info.k[0], info.k[4]] == pytest.approx([focal, focal], rel=1e-6)
    assert [info.k[2], info.k[5]] == pytest.approx([size[0] / 2, size[1] / 2], abs=0.51)
    image = settled(client, f"/camera/{name}/color")
    assert (image.width, image.height, image.encoding) == (*size, "rgb8")
    assert image.header.frame_id == info.header.frame_id == f"{name}_frame"
    pixels = np.frombuffer(bytes(image.data), np.uint8).reshape(size[1], size[0], 3)
    red, green, blue = pixels[size[1] // 2, size[0] // 2].astype(int)
    assert green > 200, "the wall ahead is green"
    assert max(red, blue) < 50
    depth = settled(client, f"/camera/{name}/depth")
    distances = np.frombuffer(bytes(depth.data), np.float32).reshape(size[1], size[0])
    assert distances[size[1] // 2, size[0] // 2] == pytest.approx(ROOM["x"][1] - EYE[0], abs=1e-3)


@pytest.mark.parametrize(("topic", "frame", "count"), [("/scan", "scanner", 61), ("/turned/scan", "turned", 360)])
def test_lidars_measure_the_distances_of_the_walls(client, topic, frame, count):
    message = settled(client, topic)
    assert message.header.frame_id == frame
    assert len(message.ranges) == count
    assert message.range_max == 12.0
    angles = message.angle_min + message.angle_increment * np.arange(count)
    wanted = [distance(angle) for angle in angles]
    assert np.abs(np.array(message.ranges) - wanted).max() < 1e-3


def test_a_lidar_of_mujoco_inputs_measures_the_distances_of_the_walls(client):
    message = settled(client, "/beams/scan")
    assert message.header.frame_id == "scanner"
    assert len(message.ranges) == 11
    angles = message.angle_min + message.angle_increment * np.arange(11)
    assert angles[0] == pytest.approx(-0.5)
    assert np.abs(np.array(message.ranges) - [distance(angle) for angle in angles]).max() < 1e-3


def test_each_frame_of_a_message_is_in_tf_at_its_place(client):
    client.wait_for("/tf_static", timeout=60.0)
    found = {}
    for topic in ("/tf", "/tf_static"):
        for transform in client.subscribe(topic).next(timeout=60.0).transforms:
            found[transform.child_frame_id] = (transform.header.frame_id, transform.transform)
    frames = {"imu", "tool", "camera_frame", "eye_frame", "scanner", "turned"}
    assert frames <= set(found)
    parent, where = found["turned"]
    assert parent == "base"
    assert [where.translation.x, where.translation.y, where.translation.z] == pytest.approx(LIDAR, abs=1e-9)
    assert where.rotation.z == pytest.approx(math.sin(LIDAR_YAW / 2), abs=1e-9)
