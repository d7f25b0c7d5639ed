import pytest

from mjplug.config.load import load
from mjplug.config.problem import ConfigError
from mjplug.config.ros_params import is_ros_file, matches, node_names

HEARTBEAT = """\
/**:
  ros__parameters:
    mujoco_plugins:
      heart_beat_plugin:
        type: "mujoco_ros2_control_plugins/HeartbeatPublisherPlugin"
        update_rate: 1.0
"""

WRENCH = """\
/**:
  ros__parameters:
    mujoco_plugins:
      external_wrench:
        type: "mujoco_ros2_control_plugins/ExternalWrenchPlugin"
        force_arrow_scale: 0.01      # 100 N  → 1 m arrow
        torque_arrow_scale: 0.1      # 10 N·m → 1 m arrow
"""

BASE_VELOCITY = """\
/**:
  ros__parameters:
    mujoco_plugins:
      base_velocity_plugin:
        type: "mujoco_ros2_control_plugins/BaseVelocityPlugin"
        body: base_link
        cmd_vel_topic: /cmd_vel
"""

FREE_JOINTS = """\
/**:
  ros__parameters:
    mujoco_plugins:
      free_joint_state_publisher:
        type: "mujoco_ros2_control_plugins/FreeJointStatePublisherPlugin"
        frame_id: ""              # world frame; set to a body name to publish relative poses
        body_names: []            # empty = all free-joint bodies
        topic: "free_joint_states"
        publish_rate: 50.0
"""

CAMERA = """\
/**:
  ros__parameters:
    mujoco_plugins:
      mujoco_camera_plugin:
        type: "mujoco_ros2_control_plugins/CameraPlugin"
        # Note all cameras are published at the same rate
        camera_publish_rate: 5.0
        camera:
          frame_name: camera_color_optical_frame
          info_topic: /camera_topic/color/camera_info
          image_topic: /camera_topic/color/image_raw
          depth_topic: /camera_topic/aligned_depth_to_color/image_raw
"""

LIDAR = """\
/**:
  ros__parameters:
      mujoco_3d_lidar_plugin:
        type: "mujoco_ros2_control_plugins/Mujoco3dLidarPlugin"
        2d_lidar:
          frame_name: "lidar_sensor_frame"
          topic: "/lidar_scan_2d"
        3d_lidar:
          frame_name: "3d_lidar_sensor_frame"
          topic: "/lidar_points_3d"
"""

DOCUMENTED = {
    HEARTBEAT: ("heart_beat_plugin", "HeartbeatPublisherPlugin", {"update_rate": 1.0}),
    WRENCH: ("external_wrench", "ExternalWrenchPlugin", {"force_arrow_scale": 0.01, "torque_arrow_scale": 0.1}),
    BASE_VELOCITY: ("base_velocity_plugin", "BaseVelocityPlugin", {"body": "base_link", "cmd_vel_topic": "/cmd_vel"}),
    FREE_JOINTS: (
        "free_joint_state_publisher",
        "FreeJointStatePublisherPlugin",
        {"frame_id": "", "body_names": [], "topic": "free_joint_states", "publish_rate": 50.0},
    ),
    CAMERA: (
        "mujoco_camera_plugin",
        "CameraPlugin",
        {
            "camera_publish_rate": 5.0,
            "camera": {
                "frame_name": "camera_color_optical_frame",
                "info_topic": "/camera_topic/color/camera_info",
                "image_topic": "/camera_topic/color/image_raw",
                "depth_topic": "/camera_topic/aligned_depth_to_color/image_raw",
            },
        },
    ),
    LIDAR: (
        "mujoco_3d_lidar_plugin",
        "Mujoco3dLidarPlugin",
        {
            "2d_lidar": {"frame_name": "lidar_sensor_frame", "topic": "/lidar_scan_2d"},
            "3d_lidar": {"frame_name": "3d_lidar_sensor_frame", "topic": "/lidar_points_3d"},
        },
    ),
}


@pytest.fixture
def params(tmp_path, monkeypatch):
    """Loads the text of a ROS parameter file."""
    monkeypatch.chdir(tmp_path)

    def load_text(text, *sets, model="m.xml"):
        (tmp_path / "params.yaml").write_text(text)
        return load("params.yaml", model=model, sets=sets, environ={})

    return load_text


def entries(loaded):
    return {name: (entry.type, entry.parameters) for name, entry in loaded.settings.plugins.items()}


@pytest.mark.parametrize("text", DOCUMENTED)
def test_a_documented_example_loads_unchanged(params, text):
    name, kind, parameters = DOCUMENTED[text]
    assert entries(params(text)) == {name: (f"mujoco_ros2_control_plugins/{kind}", parameters)}


@pytest.mark.parametrize("text", DOCUMENTED)
def test_a_documented_example_loads_as_our_own_form(tmp_path, text):
    name, kind, parameters = DOCUMENTED[text]
    indented = text.split("    mujoco_plugins:\n")[-1].split("ros__parameters:\n")[-1]
    (tmp_path / "own.yaml").write_text(f"model: m.xml\nplugins:\n{indented}")
    loaded = load(tmp_path / "own.yaml", environ={})
    assert entries(loaded) == {name: (f"mujoco_ros2_control_plugins/{kind}", parameters)}
    assert loaded.warnings == ()


def test_a_plugin_outside_of_mujoco_plugins_is_taken_with_a_warning(params):
    loaded = params(LIDAR)
    assert [str(warning) for warning in loaded.warnings] == [
        "params.yaml:3:7: warning: the plugin 'mujoco_3d_lidar_plugin' should be under `mujoco_plugins:`, "
        "because mujoco_ros2_control reads it there\n"
        "    3 |       mujoco_3d_lidar_plugin:\n"
        "      |       ^"
    ]


def test_parameters_of_other_software_are_ignored(params):
    loaded = params(
        HEARTBEAT
        + "    update_rate: 500\n"
        + "    use_sim_time: true\n"
        + "    joint_state_broadcaster:\n"
        + "      type: joint_state_broadcaster/JointStateBroadcaster\n"
        + "controller_manager:\n"
        + "  ros__parameters: {mujoco_plugins: {other: {}}}\n"
    )
    assert list(loaded.settings.plugins) == ["heart_beat_plugin"]
    assert loaded.warnings == ()


def test_use_sim_time_false_gets_a_warning_and_text_an_error(params):
    assert [str(warning) for warning in params(HEARTBEAT + "    use_sim_time: false\n").warnings] == [
        "params.yaml:7:19: warning: use_sim_time: false has no effect, because the server publishes the simulated "
        "time\n"
        "    7 |     use_sim_time: false\n"
        "      |                   ^"
    ]
    with pytest.raises(ConfigError, match=r"params\.yaml:7:19: error: use_sim_time must be true or false"):
        params(HEARTBEAT + "    use_sim_time: 'true'\n")


def test_later_sections_win_one_parameter_at_a_time(params):
    loaded = params(
        "/**: {ros__parameters: {mujoco_plugins: {a: {type: x, rate: 1, topic: t}}}}\n"
        "mjplug: {ros__parameters: {mujoco_plugins.a.rate: 2}}\n"
        "other: {ros__parameters: {mujoco_plugins.a.rate: 3}}\n"
        "/*: {ros__parameters: {mujoco_plugins: {a.topic: u, b.type: 'y'}}}\n"
    )
    assert entries(loaded) == {"a": ("x", {"rate": 2, "topic": "u"}), "b": ("y", {})}


def test_dotted_and_nested_names_mean_the_same(params):
    nested = params("/**: {ros__parameters: {mujoco_plugins: {cam: {type: x, camera: {frame_name: f, l: [1, 2]}}}}}")
    dotted = params(
        "/**:\n  ros__parameters:\n    mujoco_plugins.cam.type: x\n    mujoco_plugins.cam.camera.frame_name: f\n"
        "    mujoco_plugins.cam: {camera.l: [1, 2]}\n"
    )
    assert entries(nested) == entries(dotted) == {"cam": ("x", {"camera": {"frame_name": "f", "l": [1, 2]}})}


def test_namespaces_may_be_nested(params):
    text = "robot1:\n  sim:\n    ros__parameters: {mujoco_plugins: {a: {type: x}}}\n"
    assert list(params(text, "namespace=robot1", "node_name=sim").settings.plugins) == ["a"]


@pytest.mark.parametrize(
    ("pattern", "node", "expected"),
    [
        ("/**", "/mjplug", True),
        ("/**", "/a/b/mjplug", True),
        ("**", "/a/mjplug", True),
        ("/*", "/mjplug", True),
        ("/*", "/a/mjplug", False),
        ("/*/mjplug", "/a/mjplug", True),
        ("/a/**", "/a/b/mjplug", True),
        ("/a/**", "/b/mjplug", False),
        ("/**/mjplug", "/mjplug", True),
        ("/**/mjplug", "/a/b/mjplug", True),
        ("mjplug", "/mjplug", True),
        ("/mjplug", "/mjplug", True),
        ("mjplug", "/a/mjplug", False),
        ("/a/mjplug", "/a/mjplug", True),
        ("/a.mjplug", "/axmjplug", False),
    ],
)
def test_node_patterns(pattern, node, expected):
    assert matches(pattern, node) is expected


def test_sections_for_the_node_of_mujoco_ros2_control_are_ours(params):
    text = HEARTBEAT.replace("/**", "mujoco_ros2_control_node")
    assert list(params(text).settings.plugins) == ["heart_beat_plugin"]
    assert node_names("robot1", "sim") == (
        "/robot1/sim",
        "/robot1/mujoco_ros2_control_node",
        "/mujoco_ros2_control_node",
    )


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ({"/**": {"ros__parameters": {}}}, True),
        ({"ns": {"node": {"ros__parameters": None}}}, True),
        ({"model": "a", "/**": {"ros__parameters": {}}}, True),
        ({"model": "a", "plugins": {"a": {"type": "b"}}}, False),
        ({"ros__parameters": {}}, False),
        ([], False),
        (None, False),
    ],
)
def test_detection(value, expected):
    assert is_ros_file(value) is expected


def refusal(params, text, *sets, model="m.xml"):
    with pytest.raises(ConfigError) as caught:
        params(text, *sets, model=model)
    return str(caught.value)


def test_a_ros_file_alone_has_no_model(params):
    assert refusal(params, HEARTBEAT, model=None) == (
        "params.yaml: error: no model: a ROS parameter file contains no model; give --model FILE"
    )


def test_an_entry_without_a_type_is_an_error_in_the_ros_file(params):
    assert refusal(params, HEARTBEAT.replace("type:", "typ:")) == (
        "params.yaml:4:7: error: plugins.heart_beat_plugin.type: required, but not given\n"
        "    4 |       heart_beat_plugin:\n"
        "      |       ^"
    )


def test_a_file_for_other_nodes_reports_it(params):
    assert refusal(params, HEARTBEAT.replace("/**", "/robot1/sim")) == (
        "params.yaml:1:1: error: no section with mujoco_plugins applies to the node '/mjplug'; "
        "this file has sections for '/robot1/sim'\n"
        "    1 | /robot1/sim:\n"
        "      | ^ set `node_name: sim`, or write '/**' here"
    )


def test_a_file_without_plugins_is_only_worth_a_warning(params):
    loaded = params("controller_manager: {ros__parameters: {update_rate: 100}}")
    assert [str(warning) for warning in loaded.warnings] == [
        "params.yaml: warning: the file has no mujoco_plugins, so it adds no plugin"
    ]
    assert params("/**: {ros__parameters: {mujoco_plugins: }}").warnings == ()


def test_what_is_no_section_is_an_error(params):
    assert refusal(params, HEARTBEAT + "model: a.xml\nb: {ros__parameters: 3}\n") == (
        "params.yaml:7:1: error: 'model' is not a section of a ROS parameter file, because it has no ros__parameters\n"
        "    7 | model: a.xml\n"
        "      | ^ for other settings, write a configuration file that lists this file in `ros_params`\n"
        "params.yaml:8:22: error: ros__parameters must be a mapping of parameters\n"
        "    8 | b: {ros__parameters: 3}\n"
        "      |                      ^"
    )


GAINS = """\
/**:
  ros__parameters:
    pid_gains:
      position:
        joint1: {p: 15000.0, i: 0.0, d: 1000.0}
"""


def test_gains_of_the_hardware_component_are_told_where_they_belong(tmp_path):
    (tmp_path / "mujoco_pid.yaml").write_text(GAINS)
    loaded = load(tmp_path / "mujoco_pid.yaml", model="a.xml", environ={})
    told = [str(warning) for warning in loaded.warnings]
    assert any(
        "mujoco_pid.yaml:3:5: warning: pid_gains of the hardware component are not used; PID gains are parameters of "
        "the plugin joint_commands"
        in line
        and "plugins: {joints: {type: joint_commands, pid_gains: ...}}" in line
        for line in told
    ), told
