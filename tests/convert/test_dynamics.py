"""Base, wheels, actuators, inertia and contacts: the converted robot stands, holds and drives."""

import mujoco
import numpy as np
import pytest
import yaml

from convert.robots import ARM, BALL, BOX, ROVER, at_home, converted, joint, link, notes, robot
from mjplug.convert.inertia import principal
from mjplug.convert.report import Report
from mjplug.convert.robot import Inertial
from mjplug.errors import ModelError
from mjplug.testing import World
from mjplug_plugins.diff_drive import DiffDrive
from mjplug_schemas.geometry_msgs import Twist, Vector3

LEG = '<cylinder radius="0.03" length="0.3"/>'


def biped():
    parts = [link("torso", 5.0, shape='<box size="0.2 0.3 0.2"/>', inertia=BALL.replace("0.01", "0.1"))]
    for side, y in (("left", "0.1"), ("right", "-0.1")):
        parts += [
            link(f"{side}_leg", 1.0, shape=LEG),
            joint(f"{side}_hip", "torso", f"{side}_leg", xyz=f"0 {y} -0.3", limit='lower="-1" upper="1"'),
        ]
    return robot(*parts)


def footprint():
    return robot(
        link("base_footprint", 0),
        link("body", 2.0, shape=BOX),
        joint("up", "base_footprint", "body", "fixed", xyz="0 0 0.2"),
    )


def lidar_arm():
    """Returns an arm whose last joint is continuous with a horizontal axis."""
    return robot(
        link("base", shape=BOX),
        link("a"),
        link("b"),
        joint("i", "base", "a", xyz="0 0 0.2"),
        joint("j", "a", "b", "continuous"),
    )


@pytest.mark.parametrize(
    ("text", "free"),
    [
        (ARM, False),
        (ROVER, True),
        (biped(), True),
        (footprint(), True),
        (lidar_arm(), False),
        (robot(link("thing", shape=BOX)), True),
        (robot(link("frame", 0)), False),
        (
            ROVER.replace(
                '<robot name="rover">',
                '<robot name="rover">' + link("world", 0) + joint("m", "world", "base_link", "fixed"),
            ),
            False,
        ),
    ],
    ids=["arm", "rover", "biped", "footprint", "arm with continuous joint", "thing", "frame", "rover in the world"],
)
def test_the_base_is_recognized(tmp_path, text, free):
    conversion, model = converted(tmp_path, text)
    assert conversion.free == free
    assert any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE) == free


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_the_base_can_be_chosen(tmp_path, base):
    conversion, model = converted(tmp_path, ARM, base=base)
    assert conversion.free == (base == "free")
    assert (model.nq > 2) == (base == "free")


def test_a_free_robot_stands_just_above_the_floor(tmp_path):
    _, model = converted(tmp_path, ROVER)
    data = at_home(model)
    assert data.joint("base_link_free").qpos[2] == pytest.approx(0.101, abs=1e-6)
    mujoco.mj_step(model, data, 1000)
    assert data.joint("base_link_free").qpos[2] == pytest.approx(0.1, abs=2e-3)


def test_an_arm_holds_its_pose_for_ten_seconds(tmp_path):
    conversion, model = converted(tmp_path, ARM)
    data = at_home(model)
    mujoco.mj_step(model, data, 5000)
    assert np.abs(data.qpos - model.key_qpos[0]).max() < 1e-3
    assert not any(int(warning.number) for warning in data.warning)
    assert all(drive.gravcomp for drive in conversion.drives)


def test_without_gravity_compensation_an_arm_sags(tmp_path):
    _, model = converted(tmp_path, ARM, gravcomp="off")
    data = at_home(model)
    mujoco.mj_step(model, data, 2000)
    assert 1e-4 < np.abs(data.qpos - model.key_qpos[0]).max() < 0.05
    assert not model.body_gravcomp.any()


def test_a_guessed_effort_limit_overcomes_the_damping(tmp_path):
    text = robot(
        link("base", shape=BOX),
        link("head", 0.5),
        joint("pan", "base", "head", xyz="0 0 0.3", axis="0 0 1", more='<dynamics damping="0.7"/>'),
    ).replace('effort="20"', 'effort="50000"')
    _, model = converted(tmp_path, text)
    data = at_home(model)
    data.actuator("pan").ctrl[0] = 0.2
    mujoco.mj_step(model, data, 150)
    assert data.joint("pan").qpos[0] > 0.126, "63 % after 0.3 s"


def test_a_joint_that_is_too_weak_for_its_weight_is_reported(tmp_path):
    text = ARM.replace('effort="20"', 'effort="5"', 1)
    conversion, model = converted(tmp_path, text)
    topic = "effort limit below what gravity needs in some poses, so the joint sags"
    assert notes(conversion, "warning") == [(topic, "shoulder")]
    data = at_home(model)
    data.joint("shoulder").qpos[0] = data.actuator("shoulder").ctrl[0] = 1.2
    mujoco.mj_step(model, data, 2000)
    assert abs(data.joint("shoulder").qpos[0] - 1.2) > 0.1
    conversion, _ = converted(tmp_path, ARM)
    assert notes(conversion, "warning") == []


def test_a_step_is_followed_quickly_and_without_much_overshoot(tmp_path):
    _, model = converted(tmp_path, ARM)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for name in ("shoulder", "elbow"):
        data = at_home(model)
        data.actuator(name).ctrl[0] = 0.2
        path = []
        for _ in range(1000):
            mujoco.mj_step(model, data)
            path.append(float(data.joint(name).qpos[0]))
        assert max(path) < 0.22
        assert next(i for i, value in enumerate(path) if value > 0.126) * 0.002 < 0.3
        assert path[-1] == pytest.approx(0.2, abs=1e-3)


def test_wheels_drive_the_rover_at_their_speed(tmp_path):
    conversion, model = converted(tmp_path, ROVER)
    assert {drive.joint: drive.kind for drive in conversion.drives} == {
        "left_joint": "velocity",
        "right_joint": "velocity",
    }
    data = at_home(model)
    data.ctrl[:] = 4.0
    mujoco.mj_step(model, data, 1000)
    begin = data.qpos[0]
    mujoco.mj_step(model, data, 1000)
    assert (data.qpos[0] - begin) / 2.0 == pytest.approx(0.4, rel=0.05)
    assert abs(data.qpos[1]) < 0.02


def test_a_rover_follows_cmd_vel_and_publishes_odometry(tmp_path):
    conversion, model = converted(tmp_path, ROVER)
    plugins = yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]
    assert plugins["diff_drive"] == {
        "type": "diff_drive", "body": "base_link", "wheels": ["left_joint", "right_joint"], "wheel_radius": 0.1,
    }  # fmt: skip
    assert plugins["odometry"]["publish_tf"]
    assert plugins["transforms"]["roots"] == ["base_link"]
    world = World(model)
    world.data.qpos[:] = model.key("home").qpos
    world.add(
        DiffDrive, "diff_drive", **{name: plugins["diff_drive"][name] for name in ("body", "wheels", "wheel_radius")}
    )
    for _ in range(8):
        world.publish("/cmd_vel", Twist(linear=Vector3(x=0.3), angular=Vector3(z=0.2)))
        world.loop.step(200)
    assert world.data.qvel[5] == pytest.approx(0.2, rel=0.15)
    assert np.hypot(*world.data.qvel[:2]) == pytest.approx(0.3, rel=0.1)


def test_wheels_that_are_no_differential_drive_are_reported(tmp_path):
    conversion, _ = converted(tmp_path, ROVER.replace("right_wheel", "right_mecanum_wheel"))
    assert "diff_drive" not in conversion.files["mjplug.yaml"].decode()
    assert "nothing follows cmd_vel" in "\n".join(conversion.report.lines())


def test_what_touches_the_floor_beside_the_wheels_slides(tmp_path):
    conversion, model = converted(tmp_path, ROVER)
    assert model.geom("caster_collision").friction[0] == 0.02
    assert model.geom("left_wheel_collision").friction[0] == 1.0
    topic = "part of the base that touches the floor slides like a caster"
    assert notes(conversion, "guess").count((topic, "caster_collision")) == 1


CONTROL = """<ros2_control name="s" type="system">
  <joint name="shoulder"><command_interface name="velocity"/><command_interface name="position"/>
    <state_interface name="position"><param name="initial_value">0.4</param></state_interface></joint>
  {elbow}</ros2_control>"""
ELBOW = '<joint name="elbow"><command_interface name="{}"/></joint>'


def kinds(conversion):
    return {drive.joint: drive.kind for drive in conversion.drives}


@pytest.mark.parametrize(
    ("interface", "kind"), [("velocity", "velocity"), ("effort", "motor"), ("position", "position"), ("gpio", None)]
)
def test_ros2_control_decides_the_actuators(tmp_path, interface, kind):
    text = ARM.replace("</robot>", CONTROL.format(elbow=ELBOW.format(interface)) + "</robot>")
    conversion, model = converted(tmp_path, text)
    assert kinds(conversion) == {"shoulder": "position", "elbow": kind}
    assert at_home(model).joint("shoulder").qpos[0] == 0.4
    assert at_home(model).actuator("shoulder").ctrl[0] == 0.4


def test_joints_that_ros2_control_does_not_name_are_passive(tmp_path):
    conversion, model = converted(tmp_path, ARM.replace("</robot>", CONTROL.format(elbow="") + "</robot>"))
    assert kinds(conversion) == {"shoulder": "position", "elbow": None}
    assert model.nu == 1


def test_a_joint_that_others_follow_is_driven_unless_it_is_listed_as_passive(tmp_path):
    fingers = link("finger", 0.2) + link("thumb", 0.2)
    fingers += joint("grip", "tool0", "finger") + joint("other", "tool0", "thumb", more='<mimic joint="grip"/>')
    text = ARM.replace("</robot>", f"{fingers}{CONTROL.format(elbow=ELBOW.format('position'))}</robot>")
    conversion, _ = converted(tmp_path, text)
    assert kinds(conversion) == {"shoulder": "position", "elbow": "position", "grip": "position", "other": None}
    passive = '<joint name="grip"><state_interface name="position"/></joint></ros2_control>'
    conversion, _ = converted(tmp_path, text.replace("</ros2_control>", passive))
    assert kinds(conversion)["grip"] is None


def transmission(name, interface):
    return (
        f'<transmission name="t_{name}"><type>transmission_interface/SimpleTransmission</type><joint name="{name}">'
        f"<hardwareInterface>hardware_interface/{interface}</hardwareInterface></joint>"
        f'<actuator name="m"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>'
    )


def test_transmissions_decide_the_actuators(tmp_path):
    parts = transmission("shoulder", "EffortJointInterface") + transmission("elbow", "JointStateInterface")
    conversion, _ = converted(tmp_path, ARM.replace("</robot>", f"{parts}</robot>"))
    assert kinds(conversion) == {"shoulder": "motor", "elbow": None}
    conversion, _ = converted(tmp_path, ARM.replace("</robot>", f"{parts}</robot>"), actuators="position")
    assert kinds(conversion) == {"shoulder": "position", "elbow": None}


def test_links_behind_a_motor_are_not_compensated_and_the_others_are(tmp_path):
    hand = link("hand", 0.2) + joint("grip", "tool0", "hand", axis="0 0 1")
    text = ARM.replace("</robot>", f"{hand}{transmission('grip', 'EffortJointInterface')}</robot>")
    conversion, model = converted(tmp_path, text)
    assert kinds(conversion) == {"shoulder": "position", "elbow": "position", "grip": "motor"}
    assert {name: model.body_gravcomp[model.body(name).id] for name in ("base", "upper", "lower", "tool0", "hand")} == {
        "base": 0.0, "upper": 1.0, "lower": 1.0, "tool0": 1.0, "hand": 0.0,
    }  # fmt: skip
    _, model = converted(tmp_path, text, actuators="motor")
    assert not model.body_gravcomp.any()


def test_transmissions_of_few_joints_do_not_make_the_others_passive(tmp_path):
    more = link("hand") + link("finger") + joint("wrist", "tool0", "hand") + joint("grip", "hand", "finger")
    text = ARM.replace("</robot>", f"{more}{transmission('grip', 'EffortJointInterface')}</robot>")
    conversion, _ = converted(tmp_path, text)
    assert kinds(conversion) == {"shoulder": "position", "elbow": "position", "wrist": "position", "grip": "motor"}


def test_no_actuators_on_request(tmp_path):
    _, model = converted(tmp_path, ARM, actuators="none")
    assert model.nu == 0


def test_home_is_inside_of_the_limits(tmp_path):
    text = robot(
        link("base", shape=BOX), link("a"), joint("j", "base", "a", xyz="0 0 0.3", limit='lower="-3" upper="-1"')
    )
    _, model = converted(tmp_path, text)
    assert at_home(model).joint("j").qpos[0] == -2.0


@pytest.mark.parametrize("value", ["nan", "inf", "-1e300", "zero", ""])
def test_an_initial_position_that_is_no_position_is_reported_and_ignored(tmp_path, value):
    initial = f'<state_interface name="position"><param name="initial_value">{value}</param></state_interface>'
    control = (
        f'<ros2_control name="c"><joint name="j"><command_interface name="position"/>{initial}</joint></ros2_control>'
    )
    text = robot(link("base", shape=BOX), link("a"), joint("j", "base", "a", "continuous", xyz="0 0 0.3"), control)
    conversion, model = converted(tmp_path, text)
    assert at_home(model).joint("j").qpos[0] == 0.0
    assert ("initial position is not a number below 1e+10", "j") in notes(conversion, "warning")


@pytest.mark.parametrize("value", ["nan", "inf", "1e10", "zero"])
def test_a_home_of_an_srdf_that_is_no_position_is_an_error(tmp_path, value):
    srdf = tmp_path / "robot.srdf"
    srdf.write_text(f'<robot><group_state name="home"><joint name="shoulder" value="{value}"/></group_state></robot>')
    with pytest.raises(ModelError, match="the position of joint 'shoulder' is"):
        converted(tmp_path, ARM, srdf=str(srdf))


@pytest.mark.parametrize(
    ("moments", "wanted"),
    [
        ((0.0, 0.0, 0.0), (1e-7, 1e-7, 1e-7)),
        ((0.01, 0.02, 0.05), (0.02, 0.03, 0.05)),
        ((-0.01, 0.02, 0.03), (0.005 + 5e-8, 0.025 - 5e-8 + 1e-7, 0.03)),
        ((0.01, 0.02, 0.03), (0.01, 0.02, 0.03)),
    ],
)
def test_impossible_inertias_are_repaired(moments, wanted):
    report = Report()
    found, _ = principal(Inertial(1.0, np.eye(4), np.diag(moments)), "part", report)
    assert np.allclose(found, wanted, rtol=0, atol=2e-7)
    assert found[0] + found[1] >= found[2] * (1 - 1e-9)
    assert bool(report.of("repair")) == (moments != wanted)


def test_a_robot_with_impossible_inertias_and_links_without_mass_loads(tmp_path):
    text = robot(
        link("base", shape=BOX),
        link("a", 1.0, inertia='<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'),
        link("b", 0.0, shape=BOX),
        link("c", 0.0),
        joint("i", "base", "a", xyz="0 0 1"), joint("j", "a", "b", xyz="0 0 1"), joint("k", "b", "c", xyz="0 0 1"),
    )  # fmt: skip
    conversion, model = converted(tmp_path, text)
    assert [float(model.body(name).mass[0]) for name in "abc"] == pytest.approx([1.0, 1.0, 0.001])
    topics = {topic for topic, _ in notes(conversion, "guess", "repair")}
    assert {
        "impossible inertia",
        "mass from the geometry at 1000 kg/m³",
        "mass of 1 g for a moving link without mass",
    } <= topics


def test_links_without_inertial_have_no_mass(tmp_path):
    _, model = converted(tmp_path, ARM)
    assert float(model.body("base").mass[0]) == 1.0
    text = robot(link("base", 1.0, shape=BOX), link("cover", 0, shape=BOX), joint("f", "base", "cover", "fixed"))
    _, model = converted(tmp_path, text)
    assert model.body_subtreemass[0] == 1.0


def overlapping():
    return robot(
        link("base", shape=BOX), link("a", shape=BOX), link("b", shape=BOX),
        joint("i", "base", "a", xyz="0 0 0.3"), joint("j", "a", "b", xyz="0 0.05 0"), link("c", shape=BOX),
        joint("k", "b", "c", xyz="0.05 0 0"),
    )  # fmt: skip


def excluded(model):
    pairs = [(signature >> 16, signature & 0xFFFF) for signature in model.exclude_signature.tolist()]
    return sorted(tuple(sorted((model.body(a).name, model.body(b).name))) for a, b in pairs)


def test_links_that_touch_at_home_do_not_collide(tmp_path):
    _, model = converted(tmp_path, overlapping())
    assert excluded(model) == [("a", "c")], "parents and children never collide"
    _, every = converted(tmp_path, overlapping(), self_collision="all")
    assert excluded(every) == []
    _, none = converted(tmp_path, overlapping(), self_collision="none")
    assert ("base", "c") in excluded(none)


def test_an_srdf_decides_collisions_and_home(tmp_path):
    srdf = tmp_path / "robot.srdf"
    srdf.write_text(
        '<robot name="test"><disable_collisions link1="c" link2="base" reason="Never"/>'
        '<group_state name="home" group="arm"><joint name="i" value="0.5"/></group_state></robot>'
    )
    _, model = converted(tmp_path, overlapping(), srdf=str(srdf), self_collision="all")
    assert excluded(model) == [("base", "c")]
    assert at_home(model).joint("i").qpos[0] == 0.5


def test_two_conversions_have_the_same_bytes(tmp_path):
    first, _ = converted(tmp_path, ROVER)
    second, _ = converted(tmp_path, ROVER)
    assert first.files == second.files
    assert str(tmp_path) not in "".join(content.decode(errors="replace") for content in first.files.values())


def test_a_robot_without_collision_geometry_can_use_its_visuals(tmp_path):
    text = robot(link("base", visual=BOX), link("a", visual=BOX), joint("j", "base", "a", xyz="0 0 0.3"))
    conversion, model = converted(tmp_path, text)
    assert model.ngeom == 3
    assert "try --collision visual" in "\n".join(conversion.report.lines())
    _, model = converted(tmp_path, text, collision="visual:a")
    assert [model.geom(i).name for i in range(model.ngeom) if model.geom(i).group[0] == 3] == ["a_collision"]
