"""The converted robot moves as its URDF says."""

from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from convert.robots import ARM, BOX, converted, joint, link, robot, rotation
from mjplug.errors import ModelError


def own_poses(text, positions):
    """Returns the poses of all links, computed from the XML by mujoco's quaternion functions alone."""
    root = ElementTree.fromstring(text)
    joints = {element.find("child").get("link"): element for element in root.iterfind("joint")}

    def pose(name):
        element = joints.get(name)
        if element is None:
            return np.zeros(3), np.eye(3)
        position, axes = pose(element.find("parent").get("link"))
        origin = element.find("origin")
        xyz, rpy = (np.array(origin.get(part).split(), float) for part in ("xyz", "rpy"))
        position, axes = position + axes @ xyz, axes @ rotation(rpy)
        value = positions.get(element.get("name"), 0.0)
        axis = np.array(element.find("axis").get("xyz").split(), float)
        axis /= np.linalg.norm(axis)
        if element.get("type") == "prismatic":
            return position + axes @ axis * value, axes
        quat, turn = np.zeros(4), np.zeros(9)
        mujoco.mju_axisAngle2Quat(quat, axis, value)
        mujoco.mju_quat2Mat(turn, quat)
        return position, axes @ turn.reshape(3, 3)

    return {element.get("name"): pose(element.get("name")) for element in root.iterfind("link")}


def test_poses_of_all_links_are_those_of_the_urdf(tmp_path):
    text = ARM.replace("</robot>", "") + (
        link("slider", 0.3)
        + joint("rail", "lower", "slider", "prismatic", xyz="0.1 0.2 0.3", rpy="0.4 -0.5 2.5", axis="1 2 3")
        + "</robot>"
    )  # fmt: skip
    _, model = converted(tmp_path, text)
    data = mujoco.MjData(model)
    generator = np.random.default_rng(1)
    for _ in range(20):
        positions = dict(zip(("shoulder", "elbow", "rail"), generator.uniform(-2, 2, 3), strict=True))
        for name, value in positions.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        for name, (position, axes) in own_poses(text, positions).items():
            body = data.body(name)
            assert np.abs(body.xpos - position).max() < 1e-9
            assert np.abs(body.xmat.reshape(3, 3) - axes).max() < 1e-9


INERTIA = '<inertia ixx="0.03" iyy="0.02" izz="0.04" ixy="0.004" ixz="-0.002" iyz="0.003"/>'


def test_masses_and_inertias_are_those_of_the_urdf(tmp_path):
    text = robot(
        link("base", shape=BOX),
        '<link name="arm"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>'
        f'<mass value="1.5"/>{INERTIA}</inertial></link>',
        joint("hinge", "base", "arm"),
    )
    _, model = converted(tmp_path, text)
    body = model.body("arm")
    assert float(body.mass[0]) == 1.5
    assert body.ipos.tolist() == [0.1, 0.2, 0.3]
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, body.iquat)
    axes = axes.reshape(3, 3)
    given = np.array([[0.03, 0.004, -0.002], [0.004, 0.02, 0.003], [-0.002, 0.003, 0.04]])
    turned = rotation((0.3, 0.2, 0.1)) @ given @ rotation((0.3, 0.2, 0.1)).T
    assert np.abs(axes @ np.diag(body.inertia) @ axes.T - turned).max() < 1e-12


def test_limits_damping_and_friction_are_those_of_the_urdf(tmp_path):
    text = robot(
        link("base", shape=BOX),
        link("a"), link("b"),
        joint("turn", "base", "a", limit='lower="-0.5" upper="1.5"', more='<dynamics damping="0.7" friction="0.2"/>'),
        joint("slide", "a", "b", "prismatic", limit='lower="0" upper="0.4"'),
    )  # fmt: skip
    _, model = converted(tmp_path, text)
    assert model.joint("turn").range.tolist() == [-0.5, 1.5]
    assert model.joint("slide").range.tolist() == [0.0, 0.4]
    assert (model.joint("turn").damping[0], model.joint("turn").frictionloss[0]) == (0.7, 0.2)
    assert model.jnt_actfrcrange[model.joint("turn").id].tolist() == [-20.0, 20.0]


def test_equal_limits_mean_no_limits(tmp_path):
    conversion, model = converted(
        tmp_path, robot(link("base", shape=BOX), link("a"), joint("turn", "base", "a", limit='lower="0" upper="0"'))
    )
    assert not model.joint("turn").limited[0]
    assert ("equal limits mean no limits", "turn") in [(n.topic, n.subject) for n in conversion.report.of("guess")]


def test_fixed_links_stay_unless_they_are_fused(tmp_path):
    _, kept = converted(tmp_path, ARM)
    _, fused = converted(tmp_path, ARM, fuse=True)
    assert [kept.body(i).name for i in range(1, kept.nbody)] == ["base", "upper", "lower", "tool0"]
    assert [fused.body(i).name for i in range(1, fused.nbody)] == ["upper", "lower"]


def test_a_root_that_is_called_world_is_the_world(tmp_path):
    text = robot(
        link("world", 0),
        link("base", shape=BOX),
        link("arm"),
        joint("mount", "world", "base", "fixed", xyz="0 0 1"),
        joint("hinge", "base", "arm"),
    )
    conversion, model = converted(tmp_path, text)
    assert not conversion.free
    assert model.body("base").parentid[0] == 0
    assert model.body("base").pos.tolist() == [0, 0, 1]


def test_mimic_joints_follow(tmp_path):
    text = robot(
        link("base", shape=BOX), link("a", 0.1, shape=BOX, at="0 0 0.1"), link("b", 0.1, at="0 0 0.1"),
        joint("leader", "base", "a", xyz="0 0.3 0.3"),
        joint("follower", "base", "b", xyz="0 -0.3 0.3", more='<mimic joint="leader" multiplier="-0.5" offset="0.1"/>'),
    )  # fmt: skip
    conversion, model = converted(tmp_path, text)
    assert [model.actuator(i).name for i in range(model.nu)] == ["leader"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.joint("follower").qpos[0] == pytest.approx(0.1)
    data.ctrl[0] = 0.8
    worst = 0.0
    for _ in range(1000):
        mujoco.mj_step(model, data)
        worst = max(worst, abs(data.joint("follower").qpos[0] - (0.1 - 0.5 * data.joint("leader").qpos[0])))
    assert worst < 5e-3, "while they move"
    assert data.joint("follower").qpos[0] == pytest.approx(0.1 - 0.5 * data.joint("leader").qpos[0], abs=1e-4)
    assert data.joint("leader").qpos[0] == pytest.approx(0.8, abs=1e-2)
    assert conversion.counts["mimic"] == 1


def test_a_mimic_of_a_joint_that_does_not_exist_is_reported(tmp_path):
    text = robot(link("base", shape=BOX), link("a"), joint("j", "base", "a", more='<mimic joint="i"/>'))
    conversion, model = converted(tmp_path, text)
    assert model.neq == 0
    assert "mimic of a joint that does not exist; the joint moves freely: j (i)" in "\n".join(conversion.report.lines())


def test_planar_floating_and_ball_joints(tmp_path):
    text = robot(
        link("odom", 0), link("base", shape=BOX), link("mast", 0.5), link("head", 0.2),
        joint("float", "odom", "base", "floating"),
        joint("carriage", "base", "mast", "planar", axis="0 0 1"),
        joint("neck", "mast", "head", "ball"),
    )  # fmt: skip
    conversion, model = converted(tmp_path, text)
    assert [model.joint(i).name for i in range(model.njnt)] == [
        "float",
        "carriage_x",
        "carriage_y",
        "carriage_yaw",
        "neck",
    ]
    assert not conversion.free, "the root link itself is fixed"
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.joint("float").qpos[2] == pytest.approx(0.051, abs=1e-6)


def chain(count):
    """Returns a robot whose links hang on each other in one row."""
    below = [link(f"l{i}") + joint(f"j{i}", f"l{i - 1}", f"l{i}", "fixed") for i in range(1, count)]
    return robot(link("l0", shape='<box size="0.1 0.1 0.1"/>'), *below)


ENTITIES = (
    '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {name} "{f"&{before};" * 10}">' for before, name in zip("abcdefgh", "bcdefghi", strict=True))
    + ']><robot name="&i;"><link name="a"/></robot>'
)
"""A file of some hundred bytes that expands to a gigabyte."""


def test_a_chain_of_300_links_is_converted(tmp_path):
    _, model = converted(tmp_path, chain(301))
    assert model.nbody == 302


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (robot(link("a"), link("b")), "several links have no parent: 'a', 'b'"),
        (robot(link("a"), link("a")), "two links have the name 'a'"),
        (robot(link("a"), link("b"), joint("j", "a", "c")), "the child of joint 'j' is 'c', but there is no such link"),
        (
            robot(link("a"), link("b"), joint("j", "a", "b"), joint("j", "b", "a")),
            "two joints have the name 'j'",
        ),
        (robot(link("a"), link("b"), joint("i", "a", "b"), joint("j", "b", "a")), "form a loop: 'a', 'b'"),
        (
            robot(link("a"), link("b"), link("c"), joint("i", "a", "c"), joint("j", "b", "c")),
            "link 'c' is the child of joints 'i' and 'j'",
        ),
        (robot(link("a"), link("b"), joint("j", "a", "b", "screw")), "joint 'j' has the type 'screw'; known: revolute"),
        (robot(link("a"), link("b"), joint("j", "a", "b", axis="0 0 0")), "the axis of joint 'j' is zero"),
        (robot(link("a"), link("b"), joint("j", "a", "b", limit='lower="1" upper="-1"')), "limits 1 to -1"),
        (robot(link("a"), link("b"), joint("j", "a", "b", xyz="0 nan 0")), "xyz of joint 'j' is '0 nan 0'"),
        (robot(link("a", 1e308)), "the mass of link 'a' is '1e+308'; it must be a number of at most 1e+30"),
        (robot(link("a", -1.0)), "the mass of link 'a' is -1 kg"),
        (robot(link("a"), link("b"), joint("j", "a", "b", more='<mimic joint="j"/>')), "joint 'j' mimics itself"),
        (
            robot(link("a"), link("b"), link("c"), joint("i", "a", "b"), joint("j", "b", "c", "floating")),
            "joint 'j' is floating below link 'b'",
        ),
        (robot(link("a"), link("world"), joint("j", "a", "world")), "link 'world' must be the root"),
        (chain(302), "link 'l301' is below more than 300 others, which is not supported"),
        (ENTITIES, "is not valid XML: limit on input amplification factor"),
        ("<robot name='x'></robot>", "contains no link"),
        ("<mujoco/>", "its root element is <mujoco>"),
        ("<robot", "is not valid XML"),
    ],
)  # fmt: skip
def test_broken_robots_are_refused_in_one_sentence(tmp_path, text, message):
    with pytest.raises(ModelError, match=r"robot\.urdf") as caught:
        converted(tmp_path, text)
    assert message in str(caught.value)
