"""The bundled robots: documented names, plausible values, and standing still without contact."""

import math
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest

BUNDLED = Path(str(files("mjplug"))) / "bundled"
MODELS = ["arm", "box", "mobile_base", "quadruped"]
LEGS = ["FL", "FR", "RL", "RR"]
LEG_JOINTS = [f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf")]

# Every mass [kg] that hangs on a moving tree, by the name of the tree's root.
MASSES = {
    "arm": {"link1": 27 + 27.5 + 2 * 0.1, "cube1": 0.1, "cube2": 0.1},
    "box": {"box": 2.0},
    "mobile_base": {"base_link": 20 + 2.0},
    "quadruped": {"base_link": 15.0},
}

NAMES = {
    "arm": {
        "body": ["cube1", "cube2"],
        "joint": ["joint1", "joint2", "gripper_left_finger_joint", "gripper_right_finger_joint"],
        "actuator": ["joint1", "joint2", "gripper_left_finger_joint"],
        "site": ["ee_link", *(f"lidar-{i:02}" for i in range(24))],
        "sensor": ["body_pos", "body_quat", "body_magnetometer", "wrist_force", *(f"lidar-{i:02}" for i in range(24))],
        "camera": ["camera"],
        "key": ["home", "start_90"],
    },
    "box": {"body": ["box"], "joint": ["box_joint"], "camera": ["overview"], "key": ["home"]},
    "mobile_base": {
        "body": ["base_link"],
        "joint": ["floating_base_joint", "arm_joint"],
        "actuator": ["arm_joint"],
        "geom": ["wall"],
        "site": ["imu", "lidar"],
        "sensor": ["imu_quat", "imu_gyro", "imu_accel"],
        "camera": ["front_camera", "overview"],
        "key": ["home"],
    },
    "quadruped": {
        "body": ["base_link"],
        "joint": ["floating_base_joint", *LEG_JOINTS],
        "actuator": LEG_JOINTS,
        "site": ["imu", "lidar"],
        "sensor": ["imu_quat", "imu_gyro", "imu_accel"],
        "camera": ["front_camera", "overview"],
        "key": ["home"],
    },
}


def load(name: str) -> mujoco.MjModel:
    # MjSpec raises the compiler's warnings as Python warnings, which fail the test; MjModel only logs them.
    return mujoco.MjSpec.from_file(str(BUNDLED / f"{name}.xml")).compile()


def at_keyframe(model: mujoco.MjModel, name: str) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
    return data


def run(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    assert np.isfinite(data.qpos).all()
    assert [warning.number for warning in data.warning] == [0] * len(data.warning)


def touching(model: mujoco.MjModel, data: mujoco.MjData) -> set[frozenset[str]]:
    return {frozenset((model.geom(c.geom1).name, model.geom(c.geom2).name)) for c in data.contact}


def height_range(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> tuple[float, float]:
    heights = []
    for _ in range(round(seconds / 0.1)):
        run(model, data, 0.1)
        heights.append(float(data.body("base_link").xpos[2]))
    return min(heights), max(heights)


def test_the_folder_holds_exactly_the_models_tested_here() -> None:
    assert sorted(path.stem for path in BUNDLED.glob("*.xml")) == MODELS


@pytest.mark.parametrize("name", MODELS)
def test_it_compiles_without_a_warning_and_needs_no_other_file(name: str) -> None:
    model = load(name)

    assert (model.nmesh, model.nhfield, model.nplugin) == (0, 0, 0)


@pytest.mark.parametrize("name", MODELS)
def test_the_promised_names_exist(name: str) -> None:
    model = load(name)

    missing = [
        f"{kind} {wanted}"
        for kind, names in NAMES[name].items()
        for wanted in names
        if mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), wanted) < 0
    ]
    assert missing == []


@pytest.mark.parametrize("name", MODELS)
def test_joints_cameras_sensors_and_keyframes_are_all_named(name: str) -> None:
    model = load(name)

    for count, one in (
        (model.njnt, model.joint),
        (model.ncam, model.camera),
        (model.nsensor, model.sensor),
        (model.nkey, model.key),
    ):
        assert all(one(i).name for i in range(count))


@pytest.mark.parametrize("name", MODELS)
def test_an_actuator_has_the_name_of_a_joint(name: str) -> None:
    model = load(name)
    joints = {model.joint(i).name for i in range(model.njnt)}

    assert {model.actuator(i).name for i in range(model.nu)} <= joints


@pytest.mark.parametrize("name", MODELS)
def test_the_masses_are_those_of_the_real_thing(name: str) -> None:
    model = load(name)

    for root, mass in MASSES[name].items():
        assert model.body(root).subtreemass[0] == pytest.approx(mass, rel=0.01), root


@pytest.mark.parametrize("name", MODELS)
def test_every_camera_has_a_resolution_that_the_offscreen_buffer_holds(name: str) -> None:
    model = load(name)

    assert model.ncam > 0
    assert (model.cam_resolution > 1).all()
    assert (model.cam_resolution <= [model.vis.global_.offwidth, model.vis.global_.offheight]).all()


@pytest.mark.parametrize("name", MODELS)
def test_keyframes_lie_within_the_ranges_of_joints_and_actuators(name: str) -> None:
    model = load(name)

    assert model.nkey > 0
    assert (model.key_time == 0).all()
    for i in range(model.nkey):
        for j in range(model.njnt):
            address = model.jnt_qposadr[j]
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
                assert np.linalg.norm(model.key_qpos[i, address + 3 : address + 7]) == pytest.approx(1, abs=1e-5)
            if model.jnt_limited[j]:
                low, high = model.jnt_range[j]
                assert low <= model.key_qpos[i, address] <= high, model.joint(j).name
        assert model.actuator_ctrllimited.all()
        assert (model.actuator_ctrlrange[:, 0] <= model.key_ctrl[i]).all()
        assert (model.key_ctrl[i] <= model.actuator_ctrlrange[:, 1]).all()


@pytest.mark.parametrize(("name", "key"), [(name, key) for name in MODELS for key in NAMES[name]["key"]])
def test_it_settles_where_the_keyframe_puts_it(name: str, key: str) -> None:
    model = load(name)
    data = at_keyframe(model, key)
    start = data.qpos.copy()

    run(model, data, 5)

    assert np.abs(data.qvel).max() < 1e-3
    assert np.abs(data.qpos - start).max() < 0.01


@pytest.mark.parametrize("name", MODELS)
def test_it_settles_without_a_keyframe_when_the_actuators_hold_the_start(name: str) -> None:
    model = load(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.ctrl[:] = data.actuator_length
    start = data.qpos.copy()

    run(model, data, 10)

    assert np.abs(data.qvel).max() < 2e-3
    assert np.abs(data.qpos - start).max() < 0.07


def test_the_quadruped_stands_still_on_its_four_feet_for_ten_seconds() -> None:
    model = load("quadruped")
    data = at_keyframe(model, "home")
    start = data.qpos.copy()

    low, high = height_range(model, data, 10)

    assert low == pytest.approx(0.307, abs=1e-3)
    assert high - low < 1e-4
    assert np.abs(data.qpos - start).max() < 1e-3
    assert touching(model, data) == {frozenset(("floor", f"{leg}_foot")) for leg in LEGS}


def test_the_quadruped_s_feet_carry_its_weight() -> None:
    model = load("quadruped")
    data = at_keyframe(model, "home")

    run(model, data, 2)

    on_feet = sum(float(data.sensor(f"{leg}_foot_contact").data[0]) for leg in LEGS)
    assert on_feet == pytest.approx(model.body("base_link").subtreemass[0] * 9.81, rel=0.01)
    assert data.sensor("imu_accel").data[2] == pytest.approx(9.81, rel=0.01)
    assert np.abs(data.actuator_force).max() < 0.5 * model.actuator_forcerange[:, 1].min()


@pytest.mark.parametrize("push", [(60, 0, 0), (-60, 0, 0), (0, 60, 0), (0, -60, 0)])
def test_the_quadruped_stays_up_when_pushed(push: tuple[float, float, float]) -> None:
    model = load("quadruped")
    data = at_keyframe(model, "home")
    base = model.body("base_link").id

    data.xfrc_applied[base, :3] = push
    run(model, data, 0.2)
    data.xfrc_applied[base] = 0
    run(model, data, 3)

    assert data.xpos[base, 2] == pytest.approx(0.307, abs=0.01)
    assert data.xmat[base, 8] > 0.999
    assert touching(model, data) == {frozenset(("floor", f"{leg}_foot")) for leg in LEGS}


@pytest.mark.parametrize("pull", [(40, 0, 0), (-40, 0, 0), (0, 40, 0), (0, -40, 0)])
def test_the_quadruped_s_feet_grip_the_floor(pull: tuple[float, float, float]) -> None:
    model = load("quadruped")
    data = at_keyframe(model, "home")
    mujoco.mj_forward(model, data)
    feet = [data.site(f"{leg}_foot").xpos.copy() for leg in LEGS]

    for share in np.linspace(0, 1, 50):
        data.xfrc_applied[model.body("base_link").id, :3] = share * np.array(pull)
        run(model, data, 0.02)

    moved = [np.linalg.norm(data.site(f"{leg}_foot").xpos - foot) for leg, foot in zip(LEGS, feet, strict=True)]
    assert max(moved) < 0.02


def test_the_quadruped_crouches_on_command() -> None:
    model = load("quadruped")
    data = at_keyframe(model, "home")
    thigh, calf = 1.1, -2.2

    for share in np.linspace(0, 1, 50):
        data.ctrl[:] = np.tile([0, 0.8 + share * (thigh - 0.8), -1.6 + share * (calf + 1.6)], 4)
        run(model, data, 0.02)
    run(model, data, 2)

    # Two links of 0.213 m at 1.1 rad from the vertical and a sole of 22 mm; the springs give a little.
    assert data.body("base_link").xpos[2] == pytest.approx(2 * 0.213 * math.cos(thigh) + 0.022, abs=0.03)
    assert data.body("base_link").xmat[8] > 0.99


@pytest.mark.parametrize("name", ["mobile_base", "quadruped"])
def test_the_lidar_sees_nothing_of_its_own_robot_in_the_horizontal_plane(name: str) -> None:
    model = load(name)
    data = at_keyframe(model, "home")
    mujoco.mj_forward(model, data)
    site = model.site("lidar").id
    hit = np.zeros(1, dtype=np.int32)

    seen = set()
    for angle in np.linspace(-math.pi, math.pi, 360, endpoint=False):
        ray = data.site_xmat[site].reshape(3, 3) @ [math.cos(angle), math.sin(angle), 0]
        mujoco.mj_ray(model, data, data.site_xpos[site], ray, None, 1, model.site_bodyid[site], hit)
        if hit[0] >= 0:
            seen.add(int(model.geom_bodyid[hit[0]]))
    assert seen == {0}


def test_the_arm_reaches_straight_forward_at_start_90() -> None:
    model = load("arm")
    data = at_keyframe(model, "start_90")

    run(model, data, 2)

    # The elbow is 1 m from the shoulder, the tool point 1.1 m from the elbow; 0.7 kg of fingers bend it a little.
    assert data.sensor("body_pos").data == pytest.approx([2.1, 0, 0], abs=0.02)
    turn = math.pi / 4
    assert data.sensor("body_quat").data == pytest.approx([math.cos(turn), 0, math.sin(turn), 0], abs=0.01)


def test_the_wrist_carries_the_gripper() -> None:
    model = load("arm")
    data = at_keyframe(model, "home")

    run(model, data, 2)

    assert data.sensor("wrist_force").data == pytest.approx([0, 0, 0.7 * 9.81], abs=0.02)


def test_the_beams_of_the_arm_fan_out_and_hit_the_board() -> None:
    model = load("arm")
    data = at_keyframe(model, "start_90")
    mujoco.mj_forward(model, data)

    tilts = []
    for i in range(24):
        site = data.site(f"lidar-{i:02}")
        forward, _, up = site.xmat.reshape(3, 3)[:, 2]
        tilts.append(math.atan2(-up, forward))
        if i > 8:
            face = 4 - 0.03
            expected = (face - site.xpos[0]) / forward
            assert data.sensor(f"lidar-{i:02}").data[0] == pytest.approx(expected, abs=1e-3)
    assert tilts == pytest.approx([-0.3 + 0.025 * i for i in range(24)], abs=1e-4)


def test_the_arm_moves_to_a_commanded_pose() -> None:
    model = load("arm")
    data = at_keyframe(model, "home")

    for share in np.linspace(0, 1, 100):
        data.ctrl[:2] = [0.8 * share, -0.5 * share]
        run(model, data, 0.02)
    run(model, data, 1)

    assert data.qpos[:2] == pytest.approx([0.8, -0.5], abs=0.01)


@pytest.mark.parametrize("opening", [-0.04, 0.004])
def test_the_fingers_of_the_gripper_move_in_mirror(opening: float) -> None:
    model = load("arm")
    data = at_keyframe(model, "home")

    data.ctrl[2] = opening
    run(model, data, 2)

    assert data.joint("gripper_left_finger_joint").qpos[0] == pytest.approx(opening, abs=1e-3)
    assert data.joint("gripper_right_finger_joint").qpos[0] == pytest.approx(-opening, abs=1e-3)


def test_the_cubes_lie_on_the_table() -> None:
    model = load("arm")
    data = at_keyframe(model, "home")

    run(model, data, 2)

    assert data.body("cube1").xpos == pytest.approx([0.5, 0.5, -2], abs=1e-3)
    assert data.body("cube2").xpos == pytest.approx([-0.5, 0.5, -2], abs=1e-3)
    assert touching(model, data) == {frozenset(("table", "cube1")), frozenset(("table", "cube2"))}


def test_the_mobile_base_glides_without_friction_until_the_wall_stops_it() -> None:
    model = load("mobile_base")
    data = at_keyframe(model, "home")
    data.qvel[0] = 0.5

    run(model, data, 4)
    assert data.body("base_link").xpos[:2] == pytest.approx([2, 0], abs=1e-3)

    # The wall's face is at 3.95 m and the base is 0.30 m long from its centre.
    run(model, data, 6)
    assert data.body("base_link").xpos[0] < 3.66
    assert data.qvel[0] < 0.25


def test_a_force_moves_the_box_as_newton_s_law_predicts() -> None:
    model = load("box")
    data = at_keyframe(model, "home")
    force, mass, steps = 4.0, 2.0, 500

    data.xfrc_applied[model.body("box").id, 0] = force
    mujoco.mj_step(model, data, nstep=steps)

    # Velocity is stepped before position, so n steps of h cover a h^2 n (n + 1) / 2.
    step, acceleration = model.opt.timestep, force / mass
    assert data.qvel[0] == pytest.approx(acceleration * step * steps, rel=1e-9)
    assert data.qpos[0] == pytest.approx(acceleration * step**2 * steps * (steps + 1) / 2, rel=1e-9)
    assert data.qpos[1:3] == pytest.approx([0, 1])


def test_a_torque_turns_the_box_by_its_moment_of_inertia() -> None:
    model = load("box")
    data = at_keyframe(model, "home")
    torque, inertia = 0.02, 2 * 0.2**2 / 6

    data.xfrc_applied[model.body("box").id, 5] = torque
    run(model, data, 1)

    assert data.qvel[5] == pytest.approx(torque / inertia * 1, rel=1e-6)
    assert data.qvel[:5] == pytest.approx([0] * 5, abs=1e-9)
