"""A robot that is driven from outside, by nothing but Zenoh: over plain keys, and as ros2_control would do it."""

import math

import mujoco
import pytest
from cli.joint_state_topic_system import JointStateTopicSystem

from mjplug.model.location import locate
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

STATES, COMMANDS = "robot_joint_states", "robot_joint_commands"

CONFIG = """
model: bundled:{robot}
sim: {{speed: {speed}, paused: {paused}, keyframe: {keyframe}}}
plugins:
  states: {{type: joint_state_publisher, topic: /robot_joint_states, interfaces: [position, velocity], rate: {rate}}}
  commands: {{type: joint_commands, topic: /robot_joint_commands, trajectory_topic: /arm/joint_trajectory}}
"""


@pytest.fixture
def served(serve, tmp_path):
    def served(robot="arm", keyframe="home", speed="max", paused="true", rate=100.0):
        text = CONFIG.format(robot=robot, keyframe=keyframe, speed=speed, paused=paused, rate=rate)
        (tmp_path / "robot.yaml").write_text(text)
        return serve("robot.yaml")

    return served


def bundled(robot):
    model = mujoco.MjModel.from_xml_path(str(locate(f"bundled:{robot}", (), {})))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    return model, data


def test_a_script_commands_poses_a_trajectory_and_a_sine_and_gets_what_mujoco_itself_computes(served, connect):
    """The server stands still between steps, so that a direct simulation can be given the very same controls."""
    client = connect(served())
    model, data = bundled("arm")
    states = client.listen(f"{STATES}/@json")

    def step(count):
        client.do("mjplug/step_simulation", steps=count)

    def command(**positions):
        fields = {"name": list(positions), "position": list(positions.values())}
        client.put(COMMANDS, JointState(**fields).to_json(), "application/json")

    step(5)
    mujoco.mj_step(model, data, 5)
    command(joint1=0.5, joint2=-0.4, gripper_left_finger_joint=-0.03)
    step(1000)
    data.ctrl[:] = 0.5, -0.4, -0.03
    mujoco.mj_step(model, data, 1000)
    pose = states.until(lambda m: m["header"]["stamp"] == {"sec": 2, "nanosec": 10_000_000})
    named = dict(zip(pose["name"], pose["position"], strict=True))
    assert named == {name: data.joint(name).qpos[0] for name in named}
    assert named["joint1"] == pytest.approx(0.5, abs=0.05)
    assert named["gripper_left_finger_joint"] == pytest.approx(-0.03, abs=2e-3)

    begin = data.qpos[:2].copy()
    goal = JointTrajectoryPoint(positions=[0.9, 0.1], time_from_start=Duration(sec=1))
    trajectory = JointTrajectory(joint_names=["joint1", "joint2"], points=[goal])
    client.put("arm/joint_trajectory", trajectory.to_json(), "application/json")
    step(1000)
    for k in range(1000):
        data.ctrl[:2] = begin + (min(k / 500, 1.0)) * ((0.9, 0.1) - begin)
        mujoco.mj_step(model, data)
    pose = states.until(lambda m: m["header"]["stamp"] == {"sec": 4, "nanosec": 10_000_000})
    assert pose["position"][:2] == pytest.approx(data.qpos[:2].tolist(), abs=1e-9)
    assert pose["position"][:2] == pytest.approx([0.9, 0.1], abs=0.05)

    for k in range(25):
        wave = 0.9 + 0.2 * math.sin(2 * math.pi * k / 25)
        command(joint1=wave)
        step(20)
        data.ctrl[0] = wave
        mujoco.mj_step(model, data, 20)
    pose = states.until(lambda m: m["header"]["stamp"] == {"sec": 5, "nanosec": 10_000_000})
    assert pose["position"][:2] == pytest.approx(data.qpos[:2].tolist(), abs=1e-9)


def test_ros2_control_s_joint_state_topic_system_drives_the_arm(served, connect):
    """Its rules as its source has them; see the class."""
    client = connect(served(paused="false", speed=5.0))
    joints = {"joint1": ["position"], "joint2": ["position"], "gripper_left_finger_joint": ["position"]}
    system = JointStateTopicSystem(client, joints, ["position", "velocity"])
    system.wait_for_state()
    system.read()
    # Before a controller is active, the commands are NaN, and are sent.
    assert system.write()
    assert all(map(math.isnan, system.sent[-1].position))
    rest = system.wait_for_state()
    assert rest.position[:2] == pytest.approx((0.0, 0.0), abs=0.05)
    system.activate()
    for k in range(1, 51):
        system.commands["position"].update(joint1=0.6 * k / 50, joint2=-0.5 * k / 50)
        system.wait_for_state()
        system.read()
        system.write()
    goal = {"joint1": 0.6, "joint2": -0.5}
    for _ in range(2000):
        state = system.wait_for_state()
        system.read()
        system.write()
        if all(abs(system.states["position"][joint] - value) < 0.03 for joint, value in goal.items()):
            break
    assert {joint: system.states["position"][joint] for joint in goal} == pytest.approx(goal, abs=0.03)
    # The publisher stops; its last command is held.
    for _ in range(200):
        state = system.wait_for_state()
    assert state.position[:2] == pytest.approx((0.6, -0.5), abs=0.03)


def test_a_command_whose_arrays_do_not_fit_is_reported_in_the_diagnostics(served, connect):
    server = served(paused="false", speed=1.0)
    client = connect(server)
    diagnostics = client.listen("diagnostics/@json")
    client.put(COMMANDS, JointState(name=["joint1", "joint2"], position=[0.3]).to_json(), "application/json")

    def refusal(message):
        told = {status["name"]: status for status in message["status"]}
        return next((s["message"] for n, s in told.items() if n.endswith("commands") and s["level"]), "")

    found = refusal(diagnostics.until(refusal))
    assert found.startswith("/robot_joint_commands: the length of position is 1, but that of name is 2")
    assert "a message on /robot_joint_commands was refused" in server.err.wait_for("refused.*").string


def test_a_robot_starts_at_the_configured_state_and_a_reset_restores_it(serve, connect, tmp_path):
    (tmp_path / "start.xml").write_text(f'<key qpos="0.3 -0.2 0 0 {"0.5 0.5 -2 1 0 0 0 " * 2}" ctrl="0.3 -0.2 0"/>')
    (tmp_path / "robot.yaml").write_text(
        CONFIG.format(robot="arm", keyframe='""', speed="max", paused="true", rate=500.0).replace(
            'keyframe: ""', "start_position_file: start.xml, initial_positions: {joint2: 0.4}"
        )
    )
    client = connect(serve("robot.yaml"))
    states = client.listen(f"{STATES}/@json")
    began = []
    for _ in range(2):
        client.do("mjplug/step_simulation", steps=1)
        began.append(states.next()["position"][:2])
        client.do("mjplug/step_simulation", steps=100)
        states.forget()
        client.do("mjplug/reset_world")
    assert began[0] == began[1] == pytest.approx([0.3, 0.4], abs=1e-3)


def test_a_wrong_start_is_a_wrong_configuration(cli):
    done = cli("serve", "bundled:arm", "--check", "--set", "sim.initial_positions={joint3: 0.1, joint1: 9.0}")
    assert done.returncode == 3
    assert "sim.initial_positions.joint3: unknown joint 'joint3', did you mean 'joint" in done.stderr
    assert "sim.initial_positions.joint1: 9 is outside the joint's range" in done.stderr
