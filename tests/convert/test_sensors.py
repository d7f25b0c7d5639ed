"""Sensors of `<gazebo>` and `<ros2_control>`, and the plugins that publish them."""

import math

import mujoco
import numpy as np
import pytest
import yaml

from convert.robots import ARM, ROVER, at_home, converted, notes
from mjplug.errors import ModelError
from mjplug.testing import World
from mjplug_plugins.sensors import Sensors


def with_sensor(text, sensor, reference="base_link", more=""):
    return text.replace("</robot>", f'<gazebo reference="{reference}"><sensor {sensor}</sensor>{more}</gazebo></robot>')


def plugins(conversion):
    return yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]


def test_a_camera_looks_forward_and_has_the_field_of_view_of_gazebo(tmp_path):
    sensor = (
        'name="eye" type="camera"><pose>0.1 0 0.2 0 0 1.5707963267948966</pose><update_rate>20</update_rate><camera>'
        "<horizontal_fov>1.2</horizontal_fov><image><width>320</width><height>160</height></image></camera>"
    )
    conversion, model = converted(tmp_path, with_sensor(ROVER, sensor))
    data = at_home(model)
    mujoco.mj_forward(model, data)
    axes = data.camera("eye").xmat.reshape(3, 3)
    assert np.allclose(-axes[:, 2], [0, 1, 0], atol=1e-9), "it looks along y, because its yaw is 90 degrees"
    assert np.allclose(axes[:, 1], [0, 0, 1], atol=1e-9)
    assert math.radians(model.camera("eye").fovy[0]) == pytest.approx(2 * math.atan(math.tan(0.6) / 2), abs=1e-6)
    assert model.cam_resolution[model.camera("eye").id].tolist() == [320, 160]
    assert plugins(conversion)["camera"]["eye"] == {"publish_rate": 20.0}


@pytest.mark.parametrize(
    ("angle", "width", "height"), [(1, 0, 480), (1, 640, -5), (1, 640, 20000), (0, 640, 480), (-1, 640, 480)]
)
def test_a_camera_without_an_image_is_an_error(tmp_path, angle, width, height):
    image = f"<image><width>{width}</width><height>{height}</height></image>"
    camera = f"<camera><horizontal_fov>{angle}</horizontal_fov>{image}</camera>"
    with pytest.raises(ModelError, match=f"camera 'eye' has an image of {width} x {height} pixels and a hor.* {angle}"):
        converted(tmp_path, with_sensor(ROVER, f'name="eye" type="camera">{camera}'))


def test_a_lidar_with_too_many_rays_is_an_error(tmp_path):
    lidar = "<lidar><scan><horizontal><samples>1e9</samples></horizontal></scan></lidar>"
    with pytest.raises(ModelError, match="lidar 'eye' has 1000000000 x 1 rays; at most 10000000 are allowed"):
        converted(tmp_path, with_sensor(ROVER, f'name="eye" type="gpu_lidar">{lidar}'))


def test_an_imu_is_published(tmp_path):
    sensor = 'name="imu" type="imu"><update_rate>50</update_rate><pose>0 0 0.1 0 0 0.5</pose>'
    conversion, model = converted(tmp_path, with_sensor(ROVER, sensor))
    assert {model.sensor(i).name for i in range(model.nsensor)} == {"imu_accel", "imu_gyro", "imu_quat"}
    assert plugins(conversion)["sensors"] == {"type": "sensors", "imu": {"rate": 50.0}}
    world = World(model)
    world.add(Sensors, "sensors")
    world.loop.step(200)
    message = world.published("/sensors/imu/imu")[-1]
    assert message.linear_acceleration.z == pytest.approx(9.81, abs=0.3)
    assert message.header.frame_id == "imu"
    assert message.orientation.z == pytest.approx(math.sin(0.25), abs=1e-2)


def test_a_force_torque_sensor_at_a_joint_measures_the_load(tmp_path):
    conversion, model = converted(tmp_path, with_sensor(ARM, 'name="wrist" type="force_torque">', "elbow"))
    data = at_home(model)
    mujoco.mj_step(model, data, 500)
    weight = np.linalg.norm(data.sensor("wrist_force").data)
    assert weight == pytest.approx(9.81, rel=0.02), "the lower arm has 1 kg, and compensation acts on the joint"
    assert "sensors" in plugins(conversion)


def test_lidars_become_lidars_with_their_angles(tmp_path):
    scan = (
        "<ray><scan><horizontal><samples>360</samples><min_angle>0</min_angle><max_angle>6.28</max_angle></horizontal>"
        "</scan><range><min>0.12</min><max>3.5</max></range></ray><update_rate>5</update_rate>"
    )
    deep = (
        "<lidar><scan><horizontal><samples>100</samples><min_angle>-1</min_angle><max_angle>1</max_angle></horizontal>"
        "<vertical><samples>16</samples><min_angle>-0.2</min_angle><max_angle>0.2</max_angle></vertical></scan></lidar>"
    )
    text = with_sensor(with_sensor(ROVER, f'name="scan" type="ray">{scan}'), f'name="cloud" type="gpu_lidar">{deep}')
    conversion, _ = converted(tmp_path, text)
    lidars = plugins(conversion)["lidar"]
    assert lidars["scan"] == {
        "site": "base_link", "resolution": [360, 1], "azimuth_range": [-math.pi, math.pi], "elevation_range": [0.0],
        "endpoint": False, "min_range": 0.12, "max_range": 3.5, "update_rate": 5.0,
    }  # fmt: skip
    assert lidars["cloud"]["resolution"] == [100, 16]
    assert lidars["cloud"]["elevation_range"] == [-0.2, 0.2]


def test_colours_friction_and_unknown_sensors_of_gazebo(tmp_path):
    more = "<material>Gazebo/Orange</material><mu1>0.4</mu1>"
    text = with_sensor(ROVER, 'name="bump" type="contact">', "left_wheel", more).replace(
        '<collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision>',
        '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
        '<collision><geometry><sphere radius="0.1"/></geometry></collision>',
    )
    conversion, model = converted(tmp_path, text)
    assert model.geom("left_wheel_collision").friction[0] == 0.4
    colours = [model.mat_rgba[i].astype(float).round(2).tolist() for i in range(model.nmat)]
    assert [1.0, 0.5, 0.1, 1.0] in colours
    assert ("Gazebo sensor without a counterpart", "bump") in notes(conversion, "loss")


def test_names_that_gazebo_does_not_find_are_reported(tmp_path):
    text = ARM.replace("</robot>", '<gazebo reference="elbo"><mu1>1</mu1></gazebo></robot>')
    conversion, _ = converted(tmp_path, text)
    assert notes(conversion, "warning")[0][1] == "elbo"


CONTROL = """<ros2_control name="s" type="system"><joint name="elbow"><command_interface name="position"/></joint>
<sensor name="imu"><state_interface name="orientation.x"/><param name="frame_id">tool0</param></sensor>
<sensor name="tcp"><param name="mujoco_type">fts</param><param name="frame_id">lower</param></sensor>
<sensor name="where"><param name="mujoco_type">pose</param><param name="frame_id">tool0</param></sensor>
<sensor name="north"><param name="mujoco_type">magnetometer</param><param name="frame_id">base</param></sensor>
<sensor name="lost"><param name="mujoco_type">imu</param></sensor>
<sensor name="odd"><state_interface name="temperature"/><param name="frame_id">base</param></sensor></ros2_control>"""


def test_sensors_of_ros2_control(tmp_path):
    conversion, model = converted(tmp_path, ARM.replace("</robot>", f"{CONTROL}</robot>"))
    names = [model.sensor(i).name for i in range(model.nsensor)]
    assert names == [
        "imu_accel", "imu_gyro", "imu_quat", "tcp_force", "tcp_torque", "where_pos", "where_quat", "north",
    ]  # fmt: skip
    assert {subject for _, subject in notes(conversion, "loss")} == {"lost", "odd"}


IMAGE = "<camera><image><width>8</width><height>8</height></image>{}</camera>"


@pytest.mark.parametrize(
    ("sensor", "plugin", "wanted"),
    [
        ('name="s" type="ray"><topic>front</topic><ray/>', "lidar", {"topic": "{ns}/front"}),
        ('name="s" type="gpu_lidar"><topic>/abs</topic><lidar/>', "lidar", {"topic": "/abs"}),
        (
            'name="s" type="ray"><ray/><plugin><ros><remapping>~/out:=laser</remapping></ros>'
            "<frame_name>caster</frame_name></plugin>",
            "lidar",
            {"topic": "{ns}/laser", "frame_name": "caster"},
        ),
        ('name="s" type="imu"><topic>imu/data</topic>', "sensors", {"topic": "{ns}/imu/data"}),
        ('name="s" type="imu"><gz_frame_id>caster</gz_frame_id>', "sensors", {"frame_id": "caster"}),
        (
            f'name="s" type="camera"><topic>cam/image</topic>{IMAGE.format("")}',
            "camera",
            {"image_topic": "{ns}/cam/image", "info_topic": "{ns}/cam/camera_info"},
        ),
        (
            f'name="s" type="depth_camera"><topic>cam/depth</topic>'
            f"{IMAGE.format('<camera_info_topic>cam/i</camera_info_topic>')}",
            "camera",
            {"depth_topic": "{ns}/cam/depth", "info_topic": "{ns}/cam/i"},
        ),
        (
            f'name="s" type="rgbd_camera"><topic>rgbd</topic>{IMAGE.format("")}',
            "camera",
            {
                "image_topic": "{ns}/rgbd/image",
                "depth_topic": "{ns}/rgbd/depth_image",
                "info_topic": "{ns}/rgbd/camera_info",
            },
        ),
    ],
)
def test_topics_and_frames_of_gazebo_are_kept(tmp_path, sensor, plugin, wanted):
    conversion, _ = converted(tmp_path, with_sensor(ROVER, sensor))
    given = plugins(conversion)[plugin]["s"]
    assert {key: value for key, value in given.items() if key in wanted or "topic" in key or "frame" in key} == wanted


def test_frames_and_conventions_that_are_not_followed_are_reported(tmp_path):
    more = "<force_torque><frame>sensor</frame><measure_direction>parent_to_child</measure_direction></force_torque>"
    sensor = f'name="s" type="force_torque"><gz_frame_id>nothing</gz_frame_id>{more}'
    conversion, _ = converted(tmp_path, with_sensor(ARM, sensor, "elbow"))
    assert notes(conversion, "loss") == [
        ("frame of a sensor that is not a link; its own frame is used", "s"),
        ("<frame> of a force-torque sensor; child is used", "s"),
        ("<measure_direction> of a force-torque sensor; child_to_parent is used", "s"),
    ]
