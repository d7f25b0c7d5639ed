import math

import mujoco
import numpy as np
import pytest
from joint_robots import GRIPPER, MIXED, compiled, recorded, stepped
from pydantic import ValidationError

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Float64MultiArray

TOPIC = "/arm/joint_commands"
RAIL, SHOULDER, ELBOW, WRIST = range(4)
"""The actuators of MIXED."""


def world_of(xml=MIXED, **parameters):
    world = World(compiled(xml))
    world.plugin = world.add(JointCommands, "arm", **parameters)
    return world


def command(world, names, **values):
    world.transport.send(TOPIC, JointState(name=names, **values))
    world.loop.step(1)


def diagnosis(world):
    return world.diagnostics.diagnose()["arm"]


def test_each_interface_reaches_the_actuator_of_its_kind_in_the_units_of_the_joint():
    world = world_of()
    command(
        world, ["rail", "shoulder", "elbow", "wrist"],
        position=[math.nan, 0.3, math.nan, math.nan], velocity=[0.7, math.nan, math.nan, math.nan],
        effort=[math.nan, math.nan, 2.0, -0.5],
    )  # fmt: skip
    # The elbow's motor has a gear of 4: 2 N·m at the joint are 0.5 at the motor.
    assert world.data.ctrl.tolist() == [0.7, 0.3, 0.5, -0.5]
    assert world.data.joint("elbow").qfrc_actuator[0] == 2.0
    assert diagnosis(world).message == "ok"


def test_physics_is_that_of_mujoco_with_the_same_controls():
    world = world_of(pid_gains={"position": {"elbow": {"p": 5.0, "d": 0.2}}})
    random = np.random.default_rng(3)
    rows = []
    for _ in range(20):
        rail, shoulder, elbow = random.uniform(-1, 1, 3)
        world.transport.send(TOPIC, JointState(name=["rail"], velocity=[rail]))
        world.transport.send(TOPIC, JointState(name=["shoulder", "elbow"], position=[shoulder, elbow]))
        rows.append(recorded(world, 50))
    model = compiled(MIXED)
    data = stepped(model, mujoco.MjData(model), np.concatenate(rows))
    assert (world.data.qpos == data.qpos).all()
    assert (world.data.qvel == data.qvel).all()


def test_the_last_command_is_held_without_any_work_per_step():
    world = world_of()
    command(world, ["shoulder"], position=[0.4])
    assert world.loop.steppers.active == ()
    world.loop.step(2000)
    assert world.data.ctrl[SHOULDER] == 0.4
    command(world, ["shoulder"], position=[math.nan])
    assert world.data.ctrl[SHOULDER] == 0.4


def test_a_command_counts_while_the_simulation_is_paused_and_moves_with_the_next_step():
    world = world_of(pid_gains={"position": {"elbow": {"p": 5.0}}})
    world.loop.pause()
    world.transport.send(TOPIC, JointState(name=["shoulder", "elbow"], position=[0.4, 0.2]))
    world.loop.turn()
    assert (world.simulation.step, world.data.ctrl[SHOULDER], world.data.ctrl[ELBOW]) == (0, 0.4, 0.0)
    world.loop.step(1)
    assert world.data.ctrl[ELBOW] == 1.0


def test_servos_hold_poses_whatever_their_gear_gain_and_bias():
    """With a gear of 3, a control in degrees and a preload, the joint moves to the commanded position."""
    xml = """
    <mujoco><option gravity="0 0 0"/><worldbody>
      <body><joint name="geared" axis="0 0 1" damping="1"/><geom size=".1"/></body>
      <body pos="1 0 0"><joint name="degrees" axis="0 0 1" damping="1"/><geom size=".1"/></body>
      <body pos="2 0 0"><joint name="integrated" axis="0 0 1" damping="1"/><geom size=".1"/></body>
    </worldbody><actuator>
      <position joint="geared" kp="20" gear="3"/>
      <general joint="degrees" gainprm=".3490658504" biastype="affine" biasprm="1.5 -20 -2" ctrlrange="-90 90"/>
      <intvelocity joint="integrated" kp="20" actrange="-9 9" gear="2"/>
    </actuator></mujoco>"""
    world = world_of(xml)
    command(world, ["geared", "degrees"], position=[0.5, -0.4])
    command(world, ["integrated"], velocity=[0.25])
    world.loop.step(2000)
    assert world.data.joint("geared").qpos[0] == pytest.approx(0.5, abs=1e-4)
    assert world.data.joint("degrees").qpos[0] == pytest.approx(-0.4, abs=1e-4)
    assert world.data.joint("integrated").qvel[0] == pytest.approx(0.25, rel=1e-3)
    assert diagnosis(world).message == "ok"


def test_a_gripper_on_a_tendon_is_told_in_metres_though_its_control_counts_to_255():
    world = world_of(GRIPPER)
    assert list(world.plugin._joints.drives) == ["finger_joint1"]
    command(world, ["finger_joint1"], position=[0.03])
    world.loop.step(2000)
    assert world.data.ctrl[0] == pytest.approx(0.03 * 255 / 0.04, rel=1e-6)
    assert world.data.qpos == pytest.approx((0.03, 0.03), abs=5e-4)


def test_the_fingers_of_the_bundled_arm_follow_the_joint_that_names_their_actuator():
    world = World(load_model("bundled:arm").model)
    world.add(JointCommands, "arm")
    command(world, ["gripper_left_finger_joint"], position=[-0.03])
    world.loop.step(1000)
    left, right = (world.data.joint(f"gripper_{side}_finger_joint").qpos[0] for side in ("left", "right"))
    assert (left, right) == pytest.approx((-0.03, 0.03), abs=1e-3)


def test_a_finger_that_goes_the_other_way_and_a_tendon_of_another_length_are_allowed_for():
    world = World(load_model("bundled:arm").model)
    right, actuator = "gripper_right_finger_joint", "gripper_left_finger_joint"
    world.add(JointCommands, "arm", actuators={right: actuator})
    command(world, [right], position=[0.02])
    assert world.data.ctrl[2] == pytest.approx(-0.02)
    doubled = world_of(GRIPPER.replace('coef=".5"', 'coef="1"'))
    command(doubled, ["finger_joint1"], position=[0.01])
    doubled.loop.step(2000)
    assert doubled.data.qpos == pytest.approx((0.01, 0.01), abs=5e-4)


def test_several_motors_share_an_effort_and_several_servos_get_the_same_target():
    xml = MIXED.replace(
        '<motor name="wrist_motor" joint="wrist"/>',
        '<motor name="wrist_motor" joint="wrist"/><motor joint="wrist" gear="2"/>'
        '<position joint="shoulder" kp="30" gear="2"/>',
    )
    world = world_of(xml)
    command(world, ["wrist", "shoulder"], effort=[0.6, math.nan], position=[math.nan, 0.2])
    assert world.data.joint("wrist").qfrc_actuator[0] == pytest.approx(0.6)
    assert world.data.ctrl[[SHOULDER, 5]] == pytest.approx((0.2, 0.4))


def test_actuators_can_be_given_to_a_joint():
    xml = MIXED.replace("</actuator>", '<general name="winch" body="cube" gainprm="2"/></actuator>')
    world = world_of(xml, actuators={"loose": "winch"})
    command(world, ["loose"], effort=[3.0])
    assert world.data.ctrl[4] == 1.5


def test_controls_are_limited_to_the_ranges_and_this_is_reported_once(caplog):
    world = world_of()
    for velocity in (3.0, 9.0):
        command(world, ["rail", "elbow"], velocity=[velocity, math.nan], effort=[math.nan, -7.0])
    assert world.data.ctrl[[RAIL, ELBOW]].tolist() == [2.0, -1.75]
    # The motor may exert 5 N at a gear of 4.
    command(world, ["elbow"], effort=[100.0])
    assert world.data.ctrl[ELBOW] == 5.0
    assert caplog.text.count("joint 'rail': the velocity command 3 is beyond the range of its actuator") == 1
    assert caplog.text.count("was limited") == 2
    free = world_of(clamp=False)
    command(free, ["rail"], velocity=[9.0])
    assert free.data.ctrl[RAIL] == 9.0


def test_a_group_takes_plain_numbers_in_its_order():
    world = world_of(
        groups={
            "efforts": {"joints": ["wrist", "elbow"], "interface": "effort"},
            "servo": {"joints": ["shoulder"], "topic": "/forward_position_controller/commands"},
        }
    )
    world.transport.send("/arm/efforts/commands", Float64MultiArray(data=[0.1, 4.0]))
    world.transport.send("/forward_position_controller/commands", Float64MultiArray(data=[-0.2]))
    world.loop.step(1)
    assert world.data.ctrl.tolist() == [0.0, -0.2, 1.0, 0.1]
    world.transport.send("/arm/efforts/commands", Float64MultiArray(data=[math.nan, 8.0]))
    world.loop.step(1)
    assert world.data.ctrl[[ELBOW, WRIST]].tolist() == [2.0, 0.1]
    world.transport.send("/arm/efforts/commands", Float64MultiArray(data=[1.0]))
    world.loop.step(1)
    assert (
        diagnosis(world).message == "/arm/efforts/commands: data contains 1 numbers, but group 'efforts' has 2 joints"
    )
    assert world.data.ctrl[[ELBOW, WRIST]].tolist() == [2.0, 0.1]


MIXED_INTERFACES = {"rail": "velocity", "shoulder": "position", "wrist": ["effort"]}


def test_lists_that_are_shorter_than_the_names_are_for_the_joints_with_that_interface():
    """As JointStateTopicSystem writes them, for a robot whose joints have different command interfaces."""
    world = world_of(command_interfaces=MIXED_INTERFACES)
    command(
        world, ["loose", "wrist", "rail", "shoulder"], position=[0.4], velocity=[-0.3], effort=[0.05]
    )  # fmt: skip
    assert world.data.ctrl.tolist() == [-0.3, 0.4, 0.0, 0.05]
    command(world, ["loose", "wrist", "rail", "shoulder"], position=[0.1, 0.2])
    refusal = diagnosis(world).message
    assert "the length of position is 2, but that of name is 4" in refusal
    assert "command_interfaces declares it for 1 of the names" in refusal
    assert world.data.ctrl[SHOULDER] == 0.4


def test_of_a_configured_joint_only_its_interfaces_are_taken_even_from_full_lists():
    world = world_of(command_interfaces={"elbow": "effort"}, pid_gains={"position": {"elbow": {"p": 1.0}}})
    command(world, ["elbow", "shoulder"], position=[0.9, 0.2], effort=[2.0, math.nan])
    assert world.data.ctrl.tolist() == [0.0, 0.2, 0.5, 0.0]
    assert world.loop.steppers.active == ()


def test_of_several_commands_that_one_actuator_could_follow_it_follows_the_position():
    gains = {"position": {"elbow": {"p": 2.0}}, "velocity": {"elbow": {"p": 7.0}}}
    world = world_of(pid_gains=gains)
    command(world, ["elbow"], position=[0.5], velocity=[3.0], effort=[4.0])
    assert world.data.ctrl[ELBOW] == 1.0
    assert [bank.count for bank in world.plugin._joints.banks] == [1, 0]


@pytest.mark.parametrize(
    ("names", "values", "sentence"),
    [
        (
            ["rail", "shoulder"],
            {"position": [0.1]},
            "the length of position is 1, but that of name is 2; send one number for each name, or",
        ),
        (["shoulder"], {"position": [0.1, 0.2]}, "the length of position is 2, but that of name is 1"),
        (["shoulder", "shoulder"], {"position": [0.1, 0.2]}, "joint 'shoulder' is listed twice: name[0] and name[1]"),
        (["shoulder", "wrist"], {"position": [0.1, math.nan], "effort": [0.0, math.inf]}, "of joint 'wrist' is inf"),
        (["wrist", "shoulder"], {"effort": [1.0, 0.0], "position": [0.0, 1e300]}, "of joint 'shoulder' is 1e+300"),
    ],
)
def test_an_invalid_message_moves_nothing_and_is_counted(names, values, sentence, caplog):
    world = world_of()
    for _ in range(3):
        command(world, names, **values)
    assert not world.data.ctrl.any()
    assert diagnosis(world).message.startswith(f"{TOPIC}: ")
    assert sentence in caplog.text
    assert len(caplog.records) == len([r for r in caplog.records if "ignored" in r.message]) + 1
    assert diagnosis(world).message == "ok"
    assert diagnosis(world).values["messages refused"] == "3"
    world.plugin.cleanup()
    assert f"3 messages on {TOPIC} were refused in all" in caplog.text


def test_what_a_joint_cannot_do_is_reported_once_and_the_rest_of_the_message_counts(caplog):
    world = world_of()
    for _ in range(3):
        command(world, ["shoulder", "wrist", "loose", "ghost"], position=[0.2, 0.3, 0.4, 0.5])
    assert world.data.ctrl.tolist() == [0.0, 0.2, 0.0, 0.0]
    assert [r.message for r in caplog.records] == [
        "commands for joint 'wrist' are ignored: it accepts effort commands, not position; set "
        "pid_gains.position.wrist to allow it",
        "commands for joint 'loose' are ignored: it has no actuator, mimics another joint, or is not in `joints`",
        "commands for joint 'ghost' are ignored: there is no commandable joint of that name",
    ]


def test_a_burst_of_messages_for_one_joint_each_moves_all_of_them():
    bodies = "".join(f'<body><joint name="j{k}" axis="0 0 1"/><geom size=".1"/></body>' for k in range(30))
    motors = "".join(f'<motor joint="j{k}"/>' for k in range(30))
    world = world_of(f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>")
    for k in range(30):
        world.transport.send(TOPIC, JointState(name=[f"j{k}"], effort=[0.1 * k]))
    # The loop handles messages for 2 ms of wall time between two steps; a busy machine needs several boundaries.
    while not world.loop.inbox.empty():
        world.loop.step(0)
    world.loop.step(1)
    assert world.data.ctrl.tolist() == [0.1 * k for k in range(30)]


def test_no_control_is_beyond_what_mujoco_bears_whatever_the_range_of_the_actuator():
    """It would drop the controls of all actuators."""
    weak = '<motor name="wrist_motor" joint="wrist" gear=".001" ctrlrange="-1e12 1e12"/>'
    world = world_of(MIXED.replace('<motor name="wrist_motor" joint="wrist"/>', weak))
    command(world, ["wrist", "rail"], effort=[9e9, math.nan], velocity=[math.nan, 1.0])
    assert world.data.ctrl[WRIST] == pytest.approx(0.99 * mujoco.mjMAXVAL)
    assert world.data.actuator_force[RAIL] == pytest.approx(50.0)


def test_two_instances_with_the_same_actuators_are_pointed_out(caplog):
    world = world_of(joints=["elbow", "wrist"])
    world.add(JointCommands, "base", joints=["rail", "shoulder"])
    assert not caplog.records
    world.add(JointCommands, "other", joints=["rail", "elbow"])
    (record,) = caplog.records
    assert record.message == (
        "plugins other and arm, base set the controls of the same actuators (rail_drive, elbow_motor); "
        "each overwrites the other"
    )


def test_made_up_names_do_not_fill_the_log(caplog):
    world = world_of()
    for number in range(100):
        command(world, [f"made_up_{number}" * 50], position=[0.1])
    assert len(caplog.records) == 20
    assert max(len(record.message) for record in caplog.records) < 250


def test_a_reset_forgets_commands_and_leaves_the_controls_that_it_put_back(arm_model):
    world = World(arm_model, keyframe="bent")
    world.add(JointCommands, "arm", pid_gains={"position": {"elbow": {"p": 3.0}}})
    command(world, ["shoulder", "elbow"], position=[1.0, 1.0])
    world.loop.step(50)
    world.loop.reset(Reset())
    world.loop.step(50)
    assert world.data.ctrl.tolist() == [0.5, 0.3]


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"joints": ["elbo"]}, "unknown joint 'elbo', did you mean 'elbow'"),
        ({"joints": ["loose"]}, "joint 'loose' has no actuator; joints with an actuator: rail, shoulder, elbow, wrist"),
        ({"joints": ["socket"]}, "neither a hinge nor a slide"),
        ({"actuators": {"elbow": ["elbow_moter"]}}, "unknown actuator 'elbow_moter', did you mean 'elbow_motor'"),
        ({"actuators": {"elbow": ["wrist_motor"], "wrist": ["wrist_motor"]}}, "is configured for two joints"),
        ({"pid_gains": {"position": {"ellbow": {"p": 1.0}}}}, "unknown joint or actuator with position gains 'ellbow'"),
        (
            {"groups": {"g": {"joints": ["wrist"], "interface": "velocity"}}},
            "joint 'wrist' accepts effort commands, not velocity",
        ),
        ({"command_interfaces": {"elbwo": "position"}}, "unknown commandable joint 'elbwo', did you mean 'elbow'"),
    ],
)
def test_a_configuration_that_does_not_fit_the_model_stops_the_start(parameters, sentence):
    with pytest.raises(MjplugError, match=sentence.replace("[", r"\[")):
        world_of(**parameters)


def test_gains_that_nothing_needs_are_pointed_out(caplog):
    world_of(pid_gains={"position": {"shoulder": {"p": 1.0}}})
    assert "the position gains of shoulder are not used" in caplog.text


def test_the_reference_s_form_of_gains_is_read_from_a_file_and_mistakes_have_their_place(tmp_path):
    file = tmp_path / "robot.yaml"
    text = """\
model: bundled:arm
plugins:
  arm:
    type: joint_commands
    command_interfaces: {joint1: position, joint2: [position, effort]}
    pid_gains:
      position:
        joint1: {p: 15000.0, i: 0.0, d: 1000.0, u_clamp_max: 10000.0, u_clamp_min: -10000.0}
        joint2: {p: 2000, i: 0.0, d: 80.0, i_clamp_max: .inf, i_clamp_min: -.inf}
"""
    file.write_text(text)
    _, (selected,) = select(read(file))
    assert selected.parameters.pid_gains.position["joint1"].u_clamp_max == 10000.0
    assert selected.parameters.command_interfaces == {"joint1": ("position",), "joint2": ("position", "effort")}
    file.write_text(text.replace("u_clamp_max", "u_max"))
    with pytest.raises(
        ConfigError, match=r"robot.yaml:8:49: error: plugins.arm.pid_gains.position.joint1.u_max: unknown"
    ):
        select(read(file))


@pytest.mark.parametrize(
    "wrong", [{"groups": {"g": {"joints": []}}}, {"command_timeout": -1.0}, {"command_interfaces": {"a": "torque"}}]
)
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ValidationError):
        JointCommands.parameters_type(**wrong)


def tracked(world, names, centre, amplitude, frequency, duration):
    """Sends a sine every 4 ms; returns the largest error after the first period [rad]."""
    places = [int(world.model.joint(name).qposadr[0]) for name in names]
    worst = 0.0
    for k in range(round(duration / 0.004)):
        wave = [c + amplitude * math.sin(2 * math.pi * frequency * 0.004 * k) for c in centre]
        world.transport.send(TOPIC, JointState(name=names, position=wave))
        world.loop.step(2)
        if 0.004 * k > 1 / frequency:
            worst = max(worst, np.abs(world.data.qpos[places] - wave).max())
    return worst


def test_the_arm_tracks_a_sine():
    world = World(load_model("bundled:arm").model)
    world.add(JointCommands, "arm")
    # A critically damped servo lags by damping / stiffness, and joint1 also sags.
    assert tracked(world, ["joint1", "joint2"], (0.4, -0.3), 0.3, 0.5, 6.0) < 0.06


def test_the_quadruped_tracks_a_sine_standing():
    world = World(load_model("bundled:quadruped").model, keyframe="home")
    world.add(JointCommands, "arm")
    thighs = [f"{leg}_thigh_joint" for leg in ("FL", "FR", "RL", "RR")]
    assert tracked(world, thighs, (0.8,) * 4, 0.1, 0.5, 6.0) < 0.05
    assert world.data.qpos[2] > 0.25
