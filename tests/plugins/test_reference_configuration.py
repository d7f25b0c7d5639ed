"""Configurations in the form that mujoco_ros2_control_plugins documents, one for each plugin, load unchanged."""

import math
import textwrap

import pytest

from mjplug.config.load import read
from mjplug.plugin import registry
from mjplug.plugin.selection import select

HEADER = "/**:\n  ros__parameters:\n    mujoco_plugins:\n"

HEARTBEAT = """
heart_beat_plugin:
  type: "mujoco_ros2_control_plugins/HeartbeatPublisherPlugin"
  update_rate: 1.0
"""

WRENCH = """
external_wrench:
  type: "mujoco_ros2_control_plugins/ExternalWrenchPlugin"
  force_arrow_scale: 0.02      # 50 N are 1 m
  torque_arrow_scale: 0.5      # 2 N·m are 1 m
"""

BASE = """
base_velocity_plugin:
  type: "mujoco_ros2_control_plugins/BaseVelocityPlugin"
  body: base_link
  cmd_vel_topic: /cmd_vel
  use_stamped_twist: true
  max_linear_velocity: 1.5
  max_yaw_rate: 2
  cmd_timeout: 0.25
"""

FREE_JOINTS = """
free_joint_state_publisher:
  type: "mujoco_ros2_control_plugins/FreeJointStatePublisherPlugin"
  frame_id: "link1"            # a body; "" is the world
  body_names: [cube2, cube1]   # [] is all of them
  topic: "/objects"
  publish_rate: 25
"""

RANGEFINDER = """
rangefinder_lidar_plugin:
  type: "mujoco_ros2_control_plugins/RangefinderLidarPlugin"
  lidar_publish_rate: 10.0
  lidar:
    frame_name: lidar_frame
    min_angle: -0.3
    max_angle: 0.3
    angle_increment: 0.025
"""

CAMERA = """
mujoco_camera_plugin:
  type: "mujoco_ros2_control_plugins/CameraPlugin"
  camera_publish_rate: 6.0
  camera:
    frame_name: camera_optical_frame
    info_topic: /camera/color/camera_info
    image_topic: /camera/color/image_raw
    depth_topic: /camera/depth/image_raw
"""

LIDAR = """
mujoco_3d_lidar_plugin:
  type: "mujoco_ros2_control_plugins/Mujoco3dLidarPlugin"
  2d_lidar:
    frame_name: "flat_frame"
    topic: "/scan_flat"
  3d_lidar:
    frame_name: "deep_frame"
    topic: "/points_deep"
"""

EXAMPLES = [
    (HEARTBEAT, "Heartbeat", {"update_rate": 1.0}),
    (WRENCH, "ExternalWrench", {"force_arrow_scale": 0.02, "torque_arrow_scale": 0.5}),
    (
        BASE,
        "BaseVelocity",
        {
            "body": "base_link",
            "cmd_vel_topic": "/cmd_vel",
            "use_stamped_twist": True,
            "max_linear_velocity": 1.5,
            "max_yaw_rate": 2.0,
            "cmd_timeout": 0.25,
        },
    ),
    (
        FREE_JOINTS,
        "FreeJointStatePublisher",
        {"frame_id": "link1", "body_names": ("cube2", "cube1"), "topic": "/objects", "publish_rate": 25.0},
    ),
    (RANGEFINDER, "RangefinderLidar", {"lidar_publish_rate": 10.0}),
    (CAMERA, "Camera", {"camera_publish_rate": 6.0}),
    (LIDAR, "Lidar", {}),
]

BELOW = {
    "RangefinderLidar": {
        "lidar": {
            "frame_name": "lidar_frame",
            "min_angle": -0.3,
            "max_angle": 0.3,
            "angle_increment": 0.025,
            "range_min": 0.0,
            "range_max": 1000.0,
            "laserscan_topic": "{ns}/scan",
        }
    },
    "Camera": {
        "camera": {
            "frame_name": "camera_optical_frame",
            "info_topic": "/camera/color/camera_info",
            "image_topic": "/camera/color/image_raw",
            "depth_topic": "/camera/depth/image_raw",
            "policy": "streaming",
        }
    },
    "Lidar": {
        "2d_lidar": {"frame_name": "flat_frame", "topic": "/scan_flat"},
        "3d_lidar": {"frame_name": "deep_frame", "topic": "/points_deep"},
    },
}
"""What stands below names of the user's own, by plugin."""

DEFAULTS = {
    "Heartbeat": {},
    "ExternalWrench": {"force_arrow_scale": 0.01, "torque_arrow_scale": 0.1},
    "BaseVelocity": {
        "cmd_vel_topic": "cmd_vel",
        "use_stamped_twist": False,
        "max_linear_velocity": math.inf,
        "max_yaw_rate": math.inf,
        "cmd_timeout": 0.5,
    },
    "FreeJointStatePublisher": {
        "frame_id": "",
        "body_names": (),
        "topic": "free_joint_states",
        "publish_rate": 50.0,
    },
    "RangefinderLidar": {"lidar_publish_rate": 5.0},
    "Camera": {"camera_publish_rate": 5.0},
    "Lidar": {},
}
"""The defaults that the reference documents."""

ALIASES = {name for name in registry.registered() if name.startswith("mujoco_ros2_control_plugins/")}


def load(tmp_path, *entries):
    (tmp_path / "plugins.yaml").write_text(HEADER + "".join(textwrap.indent(entry, " " * 6) for entry in entries))
    return select(read(tmp_path / "plugins.yaml", model="bundled:arm", environ={}))[1]


@pytest.mark.parametrize(("text", "plugin", "expected"), EXAMPLES, ids=[plugin for _, plugin, _ in EXAMPLES])
def test_the_documented_form_of_each_plugin_loads_with_its_values(tmp_path, text, plugin, expected):
    (selected,) = load(tmp_path, text)
    assert selected.name == text.split(":")[0].strip()
    assert selected.plugin_class.__name__ == plugin
    assert expected.items() <= dict(selected.parameters).items()
    below = {name: dict(parameters) for name, parameters in (selected.parameters.__pydantic_extra__ or {}).items()}
    wanted = BELOW.get(plugin, {})
    assert below.keys() == wanted.keys()
    for name, values in wanted.items():
        assert values.items() <= below[name].items()


@pytest.mark.parametrize("plugin", DEFAULTS)
def test_the_defaults_are_the_documented_ones(plugin):
    (found,) = {registry.find(name) for name in ALIASES if registry.find(name).__name__ == plugin}
    fields = found.parameters_type.model_fields
    assert {name: fields[name].default for name in DEFAULTS[plugin]} == DEFAULTS[plugin]


def test_all_of_them_load_together_in_their_order(tmp_path):
    selected = load(tmp_path, *(text for text, _, _ in EXAMPLES))
    assert [s.plugin_class.__name__ for s in selected] == [plugin for _, plugin, _ in EXAMPLES]


def test_every_plugin_of_the_reference_is_here():
    assert {alias.partition("/")[2] for alias in ALIASES} == {
        text.partition("mujoco_ros2_control_plugins/")[2].partition('"')[0] for text, _, _ in EXAMPLES
    }


def test_two_instances_of_one_plugin_have_their_own_values(tmp_path):
    other = FREE_JOINTS.replace("free_joint_state_publisher:", "second:").replace("/objects", "other")
    first, second = load(tmp_path, FREE_JOINTS, other)
    assert (first.name, first.parameters.topic) == ("free_joint_state_publisher", "/objects")
    assert (second.name, second.parameters.topic) == ("second", "other")


@pytest.mark.parametrize("entry", ["{}", "[]", '""', "null"])
def test_an_empty_list_of_bodies_may_be_written_as_ros_allows(tmp_path, entry):
    text = FREE_JOINTS.replace("[cube2, cube1]", entry)
    if entry == "[]":
        assert load(tmp_path, text)[0].parameters.body_names == ()
    else:
        with pytest.raises(Exception, match="body_names"):
            load(tmp_path, text)
