"""Transmissions and PID gains of URDFs, from the file to commands and states over Zenoh."""

import math
import time
from xml.etree import ElementTree

import pytest
import yaml

from convert.robots import BOX, converted, joint, link, notes, robot
from mjplug.client import connect
from mjplug.convert.folder import write_folder
from mjplug.convert.load import converted_robot
from mjplug.errors import ModelError
from mjplug.server.open_server import open_server
from mjplug_schemas.sensor_msgs import JointState

JOINTS = ["swing", "bend"]


def hanging(control):
    """An arm of two links and a gripper with a mimic joint, at a base without geometry."""
    long = '<box size="0.5 0.06 0.06"/>'
    bar = '<inertia ixx="0.003" iyy="0.06" izz="0.06" ixy="0" ixz="0" iyz="0"/>'
    limit = 'lower="-3" upper="3"'
    finger = 'lower="-0.045" upper="0.005"'
    mirrored = 'lower="-0.005" upper="0.045"'
    return robot(
        '<link name="world"/><link name="mount"/>',
        joint("mounting", "world", "mount", "fixed"),
        link("first", 3.0, shape=long, inertia=bar, at="0.25 0 0"),
        joint("swing", "mount", "first", limit=limit),
        link("second", 2.0, shape=long, inertia=bar, at="0.25 0 0"),
        joint("bend", "first", "second", xyz="0.6 0 0", limit=limit),
        link("left", 0.1, inertia='<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>'),
        joint("left_finger", "second", "left", "prismatic", xyz="0.6 0.05 0", axis="0 1 0", limit=finger),
        link("right", 0.1, inertia='<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>'),
        joint("right_finger", "second", "right", "prismatic", xyz="0.6 -0.05 0", axis="0 1 0", limit=mirrored,
              more='<mimic joint="left_finger" multiplier="-1"/>'),
        f'<ros2_control name="arm" type="system">{control}</ros2_control>',
        name="hanging_arm",
    ).replace('effort="20"', 'effort="200"')  # fmt: skip


def commanded(*names, interface="position"):
    return "".join(f'<joint name="{name}"><command_interface name="{interface}"/></joint>' for name in names)


def member(tag, name, reduction=None, offset=None):
    values = f"<mechanical_reduction>{reduction}</mechanical_reduction>" if reduction is not None else ""
    values += f"<offset>{offset}</offset>" if offset is not None else ""
    return f'<{tag} name="{name}" role="{name}">{values}</{tag}>'


def transmission(*members, kind="Differential", name="arm_trans"):
    plugin = f"transmission_interface/{kind}Transmission"
    return f'<transmission name="{name}"><plugin>{plugin}</plugin>{"".join(members)}</transmission>'


DIFFERENTIAL = transmission(
    member("joint", "swing", 2.0, 0.0),
    member("joint", "bend", 0.5, 0.0),
    member("actuator", "motor1"),
    member("actuator", "motor2"),
)
HARDWARE = "<hardware><plugin>mujoco_ros2_control/MujocoSystemInterface</plugin>{}</hardware>"
EVERY_JOINT = commanded("swing", "bend", "left_finger")


def plugins_of(conversion):
    return yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]


def test_a_transmission_becomes_parameters_of_commands_and_of_the_states_of_actuators(tmp_path):
    simple = transmission(
        member("joint", "left_finger", -100, 0.01), member("actuator", "spindle"), kind="Simple", name="gripper"
    )
    conversion, _ = converted(tmp_path, hanging(HARDWARE.format("") + EVERY_JOINT + DIFFERENTIAL + simple))
    plugins = plugins_of(conversion)
    expected = {
        "arm_trans": {
            "type": "differential", "joints": JOINTS, "actuators": ["motor1", "motor2"], "joint_reductions": [2.0, 0.5],
        },
        "gripper": {
            "type": "simple", "joints": ["left_finger"], "actuators": ["spindle"], "joint_reductions": [-100.0],
            "joint_offsets": [0.01],
        },
    }  # fmt: skip
    assert plugins["joint_commands"]["transmissions"] == expected
    assert plugins["actuator_states"] == {
        "type": "joint_state_publisher",
        "topic": "{ns}/mujoco_actuators_states",
        "order": "actuators",
        "side": "actuators",
        "transmissions": expected,
    }
    assert notes(conversion, "loss", "warning") == []


def reached(subscription, wanted, tolerance):
    """Waits until a message has the wanted positions."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        message = subscription.next(60)
        position = dict(zip(message.name, message.position, strict=True))
        if all(abs(position[name] - value) < tolerance for name, value in wanted.items()):
            return message
    raise AssertionError(f"{wanted} was not reached: {position}")


def serve(folder, text):
    conversion, _ = converted(folder, text)
    write_folder(folder / "arm", conversion.files, force=False)
    return open_server(folder / "arm" / "mjplug.yaml", speed="max", environ={})


def test_a_converted_robot_reaches_its_pose_on_both_sides_over_the_wire(tmp_path):
    """The pose of mujoco_ros2_control's tests: joints at 0.5 and -0.5, so actuators at 0.75 and 1.25."""
    with serve(tmp_path, hanging(EVERY_JOINT + DIFFERENTIAL)) as server, connect(server.endpoint) as client:
        joints = client.subscribe("/joint_states", JointState)
        actuators = client.subscribe("/mujoco_actuators_states", JointState)
        names, target = [*JOINTS, "left_finger"], [0.5, -0.5, -0.04]
        client.publish("/joint_commands", JointState(name=names, position=target))
        message = reached(joints, dict(zip(names, target, strict=True)) | {"right_finger": 0.04}, 2e-3)
        assert list(message.name) == [*JOINTS, "left_finger", "right_finger"]
        message = reached(actuators, {"motor1": 0.75, "motor2": 1.25, "left_finger": -0.04, "right_finger": 0.04}, 4e-3)
        assert list(message.name) == ["motor1", "motor2", "left_finger", "right_finger"]
        assert max(map(abs, message.effort)) > 1e-6
        # From the side of the actuators: joints at (1 + 0) / 4 and (1 - 0) / 1.
        client.publish("/joint_commands", JointState(name=["motor2", "motor1"], position=[0.0, 1.0]))
        reached(joints, {"swing": 0.25, "bend": 1.0}, 2e-3)
        reached(actuators, {"motor1": 1.0, "motor2": 0.0}, 4e-3)


GAINS = """
/**:
  ros__parameters:
    pid_gains:
      position:
        {0}: {{p: 2000.0, i: 400.0, d: 150.0, u_clamp_max: 500.0, u_clamp_min: -500.0}}
        {1}: {{p: 1000.0, i: 400.0, d: 60.0, u_clamp_max: 500.0, u_clamp_min: -500.0}}
        other_robot: {{p: 1.0}}
"""


@pytest.mark.parametrize("names", [JOINTS, ["motor1", "motor2"]], ids=["joints", "actuators"])
def test_gains_that_the_urdf_names_drive_motors_to_the_pose(tmp_path, names):
    (tmp_path / "pids.yaml").write_text(GAINS.format(*names))
    hardware = HARDWARE.format('<param name="pids_config_file"> pids.yaml </param>')
    with serve(tmp_path, hanging(hardware + EVERY_JOINT + DIFFERENTIAL)) as server, connect(server.endpoint) as client:
        plugin = yaml.safe_load((tmp_path / "arm" / "mjplug.yaml").read_text())["plugins"]["joint_commands"]
        assert list(plugin["pid_gains"]["position"]) == names
        assert plugin["hold_at_start"]
        tags = [element.tag for element in actuator_elements(tmp_path)]
        assert tags == ["motor", "motor", "position"]
        joints = client.subscribe("/joint_states", JointState)
        actuators = client.subscribe("/mujoco_actuators_states", JointState)
        client.publish("/joint_commands", JointState(name=JOINTS, position=[0.5, -0.5]))
        reached(joints, {"swing": 0.5, "bend": -0.5}, 0.02)
        reached(actuators, {"motor1": 0.75, "motor2": 1.25}, 0.05)


def actuator_elements(folder):
    return list(ElementTree.parse(folder / "arm" / "robot.xml").getroot().find("actuator"))


def test_motors_with_pids_are_helped_against_gravity_like_servos(tmp_path):
    (tmp_path / "pids.yaml").write_text(GAINS.format(*JOINTS))
    hardware = HARDWARE.format('<param name="pids_config_file">pids.yaml</param>')
    for option, expected in (("auto", [True, True, True]), ("off", [False, False, False])):
        conversion, model = converted(tmp_path, hanging(hardware + EVERY_JOINT), gravcomp=option)
        helped = [bool(model.jnt_actgravcomp[model.joint(name).id]) for name in (*JOINTS, "left_finger")]
        assert helped == expected
        assert [bool(model.body_gravcomp[model.body(name).id]) for name in ("first", "second")] == expected[:2]
        assert not any("do not hold a pose" in topic for topic, _ in notes(conversion, "warning"))


def test_if_both_sides_have_gains_those_of_the_actuators_are_used(tmp_path):
    text = GAINS.format(*JOINTS) + GAINS.format("motor1", "motor2").partition("position:")[2]
    (tmp_path / "pids.yaml").write_text(text)
    hardware = HARDWARE.format('<param name="pids_config_file">pids.yaml</param>')
    conversion, _ = converted(tmp_path, hanging(hardware + EVERY_JOINT + DIFFERENTIAL))
    assert list(plugins_of(conversion)["joint_commands"]["pid_gains"]["position"]) == ["motor1", "motor2"]
    conversion, _ = converted(tmp_path, hanging(hardware + EVERY_JOINT))
    assert list(plugins_of(conversion)["joint_commands"]["pid_gains"]["position"]) == JOINTS


def test_gains_of_servos_are_left_out(tmp_path):
    (tmp_path / "pids.yaml").write_text(GAINS.format(*JOINTS))
    hardware = HARDWARE.format('<param name="pids_config_file">pids.yaml</param>')
    conversion, _ = converted(tmp_path, hanging(hardware + EVERY_JOINT), actuators="position")
    assert "pid_gains" not in plugins_of(conversion)["joint_commands"]


def test_gains_of_joints_with_interfaces_for_pids_are_read(tmp_path):
    gains = (
        '<param name="position_kp">30</param><param name="position_kd">2</param><param name="position_i_max">4</param>'
    )
    own = f'<joint name="bend">{gains}<command_interface name="position_pid"/></joint>'
    old = '<joint name="swing"><param name="vel_kp">5</param><command_interface name="velocity_PID"/></joint>'
    ignored = f'<joint name="left_finger">{gains}<command_interface name="position"/></joint>'
    conversion, model = converted(tmp_path, hanging(own + old + ignored))
    assert plugins_of(conversion)["joint_commands"]["pid_gains"] == {
        "position": {"bend": {"p": 30.0, "d": 2.0, "i_clamp_max": 4.0, "i_clamp_min": -4.0}},
        "velocity": {"swing": {"p": 5.0}},
    }
    kinds = {model.actuator(i).name: bool(model.actuator_biasprm[i, 1]) for i in range(model.nu)}
    assert kinds == {"swing": False, "bend": False, "left_finger": True}


def test_a_change_of_the_gains_converts_again(tmp_path):
    (tmp_path / "pids.yaml").write_text(GAINS.format(*JOINTS))
    hardware = HARDWARE.format('<param name="pids_config_file">pids.yaml</param>')
    (tmp_path / "arm.urdf").write_text(hanging(hardware + EVERY_JOINT))
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    first, again = (converted_robot(str(tmp_path / "arm.urdf"), environ=environ) for _ in range(2))
    assert first.folder == again.folder
    (tmp_path / "pids.yaml").write_text(GAINS.format(*JOINTS).replace("2000.0", "2500.0"))
    changed = converted_robot(str(tmp_path / "arm.urdf"), environ=environ)
    assert changed.plugins()["joint_commands"]["pid_gains"]["position"]["swing"]["p"] == 2500.0


def test_a_missing_file_of_gains_is_an_error_of_the_report_and_stops_a_strict_conversion(tmp_path):
    text = hanging(HARDWARE.format('<param name="pids_config_file">gone.yaml</param>') + EVERY_JOINT)
    conversion, _ = converted(tmp_path, text)
    assert ("parameter file of PID gains (pids_config_file)", "gone.yaml") in notes(conversion, "error")
    assert conversion.counts["position"] == 3
    with pytest.raises(ModelError, match=r"pids_config_file.*there is no file"):
        converted(tmp_path, text, strict=True)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("{", "cannot be read as YAML with PID gains"),
        ("/**: {ros__parameters: {rate: 1}}", "contains no pid_gains"),
        ("- secret", "contains no pid_gains"),
        ("n: {ros__parameters: {pid_gains: {effort: {swing: {p: 1}}}}}", "pid_gains contains 'effort'"),
        ("n: {ros__parameters: {pid_gains: {position: {swing: 3}}}}", "pid_gains.position.swing must contain gains"),
        ("n: {ros__parameters: {pid_gains: {position: {swing: {p: .nan}}}}}", "swing must contain gains"),
    ],
)
def test_files_that_contain_no_gains_are_refused_without_their_content(tmp_path, content, sentence):
    (tmp_path / "pids.yaml").write_text(content)
    text = hanging(HARDWARE.format('<param name="pids_config_file">pids.yaml</param>') + EVERY_JOINT)
    with pytest.raises(ModelError, match=sentence) as refused:
        converted(tmp_path, text)
    assert "secret" not in str(refused.value)


def changed(**values):
    """Returns the differential transmission with other reductions, or another member."""
    parts = {
        "swing": member("joint", "swing", 2.0),
        "bend": member("joint", "bend", 0.5),
        "motor1": member("actuator", "motor1"),
        "motor2": member("actuator", "motor2"),
    }
    return transmission(*(parts | values).values())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (changed(swing=member("joint", "swing", 0)), "mechanical_reduction of joint 'swing' is 0; it must not be zero"),
        (changed(motor2=member("actuator", "motor2", -0.0)), "of actuator 'motor2' is -0; it must not be zero"),
        (changed(swing=member("joint", "swing", "inf")), "of joint 'swing' is 'inf'; it must be a number"),
        (changed(swing=member("joint", "swing", "two")), "of joint 'swing' is 'two'; it must be a number"),
        (changed(bend=member("joint", "bend", 1, "nan")), "the offset of joint 'bend' is 'nan'; it must be a number"),
        (changed(bend=member("joint", "bent", 1)), "names the joint 'bent', which the robot does not have.*'bend'"),
        (changed(bend=member("joint", "swing", 1)), "transmission 'arm_trans' names the joint 'swing' twice"),
        (changed(bend=""), "transmission 'arm_trans' has 1 <joint>; a differential one needs 2"),
        (changed(motor1='<actuator role="a"/>'), "a <actuator> of transmission 'arm_trans' has no name"),
        (DIFFERENTIAL.replace("plugin>", "type>"), "transmission 'arm_trans' has no <plugin>"),
    ],
)
def test_transmissions_that_cannot_work_stop_the_conversion(tmp_path, text, sentence):
    with pytest.raises(ModelError, match=sentence):
        converted(tmp_path, hanging(EVERY_JOINT + text))


def test_transmissions_that_cannot_be_served_are_reported(tmp_path):
    simple = transmission(
        member("joint", "swing"), member("actuator", "swing"), kind="Simple", name="same_name"
    ) + transmission(member("joint", "bend"), member("actuator", "motor", 7), kind="Simple", name="one")
    other = transmission(member("joint", "left_finger"), member("actuator", "motor"), kind="Simple", name="two")
    odd = transmission(member("joint", "left_finger"), member("actuator", "x"), kind="Planetary", name="odd")
    fixed = transmission(member("joint", "mounting"), member("actuator", "y"), kind="Simple", name="still")
    conversion, _ = converted(tmp_path, hanging(EVERY_JOINT + simple + other + odd + fixed))
    assert plugins_of(conversion)["joint_commands"]["transmissions"] == {
        "one": {"type": "simple", "joints": ["bend"], "actuators": ["motor"]}
    }
    assert set(notes(conversion, "warning", "loss")) == {
        ("transmission left out, because its actuator has the name of a joint", "swing"),
        ("reduction of the actuator of a simple transmission, which ros2_control ignores", "one"),
        ("transmission left out, because another one has the same name", "motor"),
        ("transmission of an unknown type; commands and states are those of the joints", "odd"),
        ("transmission of a joint without one coordinate, which has no effect", "still"),
    }


def test_a_robot_without_geometry_at_its_base_has_the_floor_out_of_reach(tmp_path):
    text = hanging(EVERY_JOINT)
    _, model = converted(tmp_path, text)
    # The length of the first link, half of the diagonal of the second one, and 1 mm.
    assert model.geom("floor").pos[2] == pytest.approx(-(0.6 + math.hypot(0.25, 0.03, 0.03) + 0.001))
    standing = text.replace(
        '<link name="mount"/>', f'<link name="mount"><collision><geometry>{BOX}</geometry></collision></link>'
    )
    _, model = converted(tmp_path, standing)
    assert -0.06 < model.geom("floor").pos[2] <= 0.0


def test_options_of_the_conversion_keep_transmissions(tmp_path):
    for options in ({"fuse": True}, {"actuators": "none"}, {"scene": "none"}):
        conversion, _ = converted(tmp_path, hanging(EVERY_JOINT + DIFFERENTIAL), **options)
        assert "arm_trans" in plugins_of(conversion)["joint_commands"]["transmissions"]
