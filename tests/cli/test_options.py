"""Settings from the command line, the environment and files, tested from outside."""

import json
import re
import shutil
import time

import pytest
from cli.client import wrench, wrenches
from cli.conftest import WORLD
from cli.process import COMMAND
from waits import until

ROS_PARAMETERS = """\
/**:
  ros__parameters:
    mujoco_plugins:
      external_wrench:
        type: "mujoco_ros2_control_plugins/ExternalWrenchPlugin"
        force_arrow_scale: 0.01      # 100 N  → 1 m arrow
        torque_arrow_scale: 0.1      # 10 N·m → 1 m arrow
      heart_beat_plugin:
        type: "mujoco_ros2_control_plugins/HeartbeatPublisherPlugin"
"""


def test_a_ros_parameter_file_with_a_model_gives_the_names_of_the_reference(serve, connect, tmp_path):
    (tmp_path / "ros.yaml").write_text(ROS_PARAMETERS)
    server = serve(
        "ros.yaml", "--model", "bundled:box", "--speed", "max", "--set", "namespace=mujoco_ros2_control_node"
    )  # fmt: skip
    client = connect(server)
    push = wrenches(wrench("box", force=(10.0, 0.0, 0.0), seconds=2.0))
    client.do("mujoco_ros2_control_node/external_wrench/apply_wrench", **push)
    assert client.listen("mujoco_heartbeat/@json").next()["data"].startswith("MuJoCo ROS2 Control Heartbeat #")
    listing = client.ask("mujoco_ros2_control_node/mjplug/interfaces")
    names = {entry["name"] for entry in [*listing["topics"], *listing["services"]]}
    assert {
        "/clock",
        "/mujoco_heartbeat",
        "/mujoco_ros2_control_node/external_wrench/apply_wrench",
        "/mujoco_ros2_control_node/external_wrench/wrench_markers",
        "/mujoco_ros2_control_node/mjplug/set_pause",
    } <= names


def test_the_name_of_the_reference_node_gives_the_reference_names_of_its_services(serve, connect, tmp_path):
    (tmp_path / "ros.yaml").write_text(ROS_PARAMETERS)
    server = serve("ros.yaml", "--model", "bundled:box", "--set", "node_name=mujoco_ros2_control_node")
    client = connect(server)
    assert client.do("mujoco_ros2_control_node/set_pause", paused=True) == "the simulation is now paused"
    names = {entry["name"] for entry in client.ask("mujoco_ros2_control_node/interfaces")["services"]}
    assert "/external_wrench/apply_wrench" in names


def test_names_are_remapped(serve, connect, tmp_path):
    (tmp_path / "config.yaml").write_text(
        "model: bundled:box\n"
        "namespace: robot1\n"
        "remap: {/robot1/external_wrench/apply_wrench: /push, /robot1/mujoco_heartbeat: /robot1/pulse}\n"
        "plugins:\n"
        "  external_wrench: {type: external_wrench}\n"
        "  heartbeat: {type: heartbeat, update_rate: 50.0}\n"
    )
    client = connect(serve("config.yaml"))
    client.do("push", **wrenches(wrench("box", force=(1.0, 0.0, 0.0))))
    assert "Heartbeat #" in client.listen("robot1/pulse/@json").next()["data"]
    names = {entry["name"] for entry in client.ask("robot1/mjplug/interfaces")["topics"]}
    assert "/robot1/mujoco_heartbeat" not in names


def test_a_module_beside_the_file_is_found_from_wherever_the_server_is_started(serve, connect, tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    shutil.copy(WORLD / "probe.py", folder)
    shutil.copy(WORLD / "scene.xml", folder)
    (folder / "config.yaml").write_text('model: scene.xml\nplugins:\n  probe: {type: "probe:Probe"}\n')
    server = serve("robot/config.yaml", "--paused", "--keyframe", "apart")
    assert server.ready.rstrip().endswith("plugins: probe · paused")
    state = json.loads(connect(server).do("probe/state"))
    assert (state["step"], state["qpos"][:3]) == (0, [1.0, 2.0, 3.0])


def test_a_duration_is_simulated_time_and_the_ready_line_is_all_there_is_on_standard_output(cli):
    done = cli("serve", "bundled:arm", "--speed", "max", "--duration", "20", "--listen", "tcp/127.0.0.1:0")
    assert done.returncode == 0
    assert re.fullmatch(r"ready · tcp/127\.0\.0\.1:\d+ · model arm \(.*\) · plugins: none · speed max\n", done.stdout)
    assert "keyframes (--keyframe): home, start_90" in done.stderr
    assert "stopped at t = 20.000 s, after 10000 steps" in done.stderr


def test_a_server_needs_no_standard_output(cli):
    closed = ["sh", "-c", 'exec "$@" >&-', "sh", *COMMAND]
    done = cli("serve", "bundled:box", "--duration", "0", "--listen", "tcp/127.0.0.1:0", command=closed)
    assert done.returncode == 0, done.stderr


def test_a_duration_without_end_is_a_usage_error(cli):
    done = cli("serve", "bundled:box", "--duration", "inf", "--listen", "tcp/127.0.0.1:0")
    assert done.returncode == 2, done.stderr
    assert "--duration" in done.stderr
    assert "Traceback" not in done.stderr


def test_check_lists_what_would_run_without_a_network_and_quiet_prints_less(cli, tmp_path):
    (tmp_path / "config.yaml").write_text(
        "model: bundled:quadruped\n"
        "zenoh: {listen: [tcp/192.0.2.1:1]}\n"
        "plugins:\n  heartbeat: {type: heartbeat}\n"
    )  # fmt: skip
    done = cli("serve", "config.yaml", "--check", "--keyframe", "home", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("ok · model ")
    assert done.stdout.endswith("· plugins: heartbeat\n")


def test_the_command_line_beats_the_environment_and_that_beats_the_file(serve, connect, tmp_path):
    (tmp_path / "config.yaml").write_text(
        "model: bundled:box\nnamespace: of_file\nnode_name: of_file\nsim: {speed: 3.0, clock_rate: 7.0}\n"
    )
    server = serve(
        "config.yaml", "--set", "sim.speed=5",
        env={"MJPLUG_NODE_NAME": "of_environment", "MJPLUG_SIM__SPEED": "4"},
    )  # fmt: skip
    assert server.ready.rstrip().endswith("speed 5")
    assert connect(server).ask("of_file/of_environment/interfaces")["name"] == "/of_file/of_environment"


def test_instances_of_one_plugin_have_names_and_parameters_of_their_own(serve, connect):
    server = serve(
        "bundled:box",
        "--plugin", "external_wrench:left", "--plugin", "mujoco_ros2_control_plugins/ExternalWrenchPlugin:right",
        "--plugin", "external_wrench", "--plugin", "heartbeat:pulse",
        "--set", "plugins.pulse.topic=/robot/pulse", "--set", "plugins.pulse.update_rate=100.0",
    )  # fmt: skip
    client = connect(server)
    services = {entry["key"] for entry in client.ask("mjplug/interfaces")["services"]}
    assert {"left/apply_wrench", "right/apply_wrench", "external_wrench/apply_wrench"} <= services
    pulse = client.listen("robot/pulse/@json")
    first, second = (float(pulse.next()["data"].rpartition(" ")[2].rstrip("s")) for _ in range(2))
    assert second - first == pytest.approx(0.01, abs=1e-9)


def test_a_keyframe_may_have_any_name_and_an_endpoint_any_address(cli, tmp_path):
    (tmp_path / "model.xml").write_text(
        '<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody>'
        '<keyframe><key name="1"/></keyframe></mujoco>'
    )
    done = cli("serve", "model.xml", "--check", "--keyframe", "1", "--listen", "tcp/[::1]:7447")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("speed", "simulated", "least", "most"), [("0.5", 0.25, 0.45, 0.7), ("2", 1.0, 0.45, 0.7)])
def test_simulated_time_advances_at_the_configured_speed(serve, connect, speed, simulated, least, most):
    clock = connect(serve("bundled:box", "--speed", speed)).listen("clock/@json")

    def seconds(tick):
        return tick["clock"]["sec"] + tick["clock"]["nanosec"] / 1e9

    def duration():
        """How long the simulated time takes [s]; a busy machine may make it longer, and then shorter to catch up."""
        clock.forget()
        start, began = seconds(clock.next()), time.monotonic()
        clock.until(lambda tick: seconds(tick) >= start + simulated)
        return time.monotonic() - began

    until(lambda: least < duration() < most)
