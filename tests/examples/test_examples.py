"""Every example runs in separate processes, prints the output in its README, and matches an independent computation."""

import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest
from camera_scenes import need_opengl
from docs.markdown import parse
from docs.terminal import matches
from machine import has_network_namespaces

EXAMPLES = Path(__file__).parents[2] / "examples"
BUNDLED = EXAMPLES.parent / "mjplug" / "bundled"
NAMES = sorted(path.name for path in EXAMPLES.iterdir() if path.is_dir() and path.name[0].isdigit())


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Runs each example once, from another folder than its own."""
    results = {}

    def ran(name):
        if name == "03_camera":
            need_opengl()
        if name not in results:
            results[name] = subprocess.run(
                [sys.executable, "-W", "error", EXAMPLES / "run.py", name],
                cwd=tmp_path_factory.mktemp("elsewhere"),
                env={key: value for key, value in os.environ.items() if not key.startswith("MJPLUG_")},
                capture_output=True, text=True, timeout=150, check=False,
            )  # fmt: skip
        return results[name]

    return ran


def numbers(pattern, text):
    """Returns the numbers in the groups of a pattern that a text must have."""
    found = re.search(pattern, text, re.MULTILINE)
    assert found, f"{pattern!r} is not in:\n{text}"
    return [float(group) for group in found.groups()]


def left_out(printed):
    return "\nleft out: " in f"\n{printed}"


def opens_a_server_itself(name):
    return any("mjplug.open_server(" in path.read_text("utf-8") for path in (EXAMPLES / name).glob("*.py"))


def test_the_numbers_of_the_examples_are_all_there():
    assert [int(name.partition("_")[0]) for name in NAMES] == list(range(len(NAMES)))


@pytest.mark.parametrize("name", NAMES)
def test_an_example_has_a_configuration_a_script_and_says_how_to_run_it(name):
    assert (EXAMPLES / name / "config.yaml").exists()
    texts = [path.read_text("utf-8") for path in (EXAMPLES / name).glob("*.py")]
    (usage,) = [found[1] for text in texts if (found := re.search(r"\nUsage: (python (-m pytest )?\w+\.py)", text))]
    readme = (EXAMPLES / name / "README.md").read_text("utf-8")
    assert f"$ python examples/run.py {name}\n" in readme
    assert f"`{usage}" in readme


@pytest.mark.parametrize("name", NAMES)
def test_an_example_runs_to_its_end_and_prints_the_output_in_its_readme(ran, name):
    done = ran(name)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    if left_out(done.stdout):
        return
    if not opens_a_server_itself(name):
        assert re.search(r"^ready · tcp/\S+:\d+ ", done.stdout, re.MULTILINE)
    # What the script prints, after the last command line.
    printed = re.split(r"^\w*\$ .*\n", done.stdout, flags=re.MULTILINE)[-1]
    (promised,) = (
        block.text
        for block in parse(name, (EXAMPLES / name / "README.md").read_text("utf-8"))
        if block.language == "output"
    )
    assert matches(printed, promised), f"printed:\n{printed}\nbut the README says:\n{promised}"


def test_a_ball_flies_as_far_as_the_integrator_says(ran):
    printed, step = ran("12_in_one_program").stdout, 0.001
    for degrees in range(15, 90, 15):
        distance, seconds = numbers(rf"^{degrees} degrees: (\S+) m in (\S+) s", printed)
        rise, count, height = 10.0 * np.sin(np.radians(degrees)), 0, 0.0
        while height >= 0.0:
            # Semi-implicit Euler: the velocity changes before the position.
            count += 1
            rise -= 9.81 * step
            height += rise * step
        assert (distance, seconds) == (
            pytest.approx(10.0 * np.cos(np.radians(degrees)) * count * step, abs=6e-4), round(count * step, 3),
        )  # fmt: skip
        # The parabola, to which the first step adds its own length at most.
        assert distance == pytest.approx(10.0**2 * np.sin(2 * np.radians(degrees)) / 9.81, abs=0.011)


def test_an_unknown_example_is_refused_with_a_list():
    done = subprocess.run(
        [sys.executable, EXAMPLES / "run.py", "99_nothing"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert ", ".join(NAMES) in done.stderr


def test_the_box_is_pushed_exactly_as_far_as_newton_s_law_predicts(ran):
    moved = numbers(r"moved by x (\S+) m, y (\S+) m, z (\S+) m in 2 s", ran("00_push_a_box").stdout)
    # 10 N on 2 kg; in the last 0.5 s the force falls linearly to zero. The velocity changes before the position.
    time_step, speed, distance = 0.002, 0.0, 0.0
    for step in range(1000):
        left = 2.0 - step * time_step
        speed += 10.0 * min(1.0, left / 0.5) / 2.0 * time_step
        distance += speed * time_step
    assert moved == [round(distance, 4), 0.0, 0.0]
    # In continuous time: 1.5 s of constant force, then the ramp.
    assert distance == pytest.approx(5.0 * 1.5**2 / 2 + 7.5 * 0.5 + 5.0 * 0.5**2 / 3, abs=0.0101)


def test_the_dog_sways_as_in_mujoco_alone(ran):
    sway, speed, end = numbers(
        r"swayed (\S+) mm .* up to (\S+) m/s, .* to (\S+) mm", ran("01_wrench_on_a_robot").stdout
    )
    model = mujoco.MjModel.from_xml_path(str(BUNDLED / "quadruped.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_step(model, data, 300)
    start, trunk = data.qpos[1], model.body("base_link").id
    sways, speeds = [], []
    for step in range(700):
        mujoco.mj_kinematics(model, data)
        fading = min(1.0, max(0.0, (0.4 - 0.002 * step) / 0.1))
        force = data.xmat[trunk].reshape(3, 3) @ [0.0, 60.0 * fading, 0.0]
        data.xfrc_applied[trunk] = [*force, *np.cross(data.xpos[trunk] - data.xipos[trunk], force)]
        mujoco.mj_step(model, data)
        sways.append(data.qpos[1] - start)
        speeds.append(data.qvel[1])
    assert sway == pytest.approx(max(sways) * 1000, abs=1.5)
    assert speed == pytest.approx(max(speeds), abs=0.011)
    assert end == pytest.approx(sways[-1] * 1000, abs=3)


def test_the_base_drives_the_circle_that_its_command_means(ran):
    low, high, turned = numbers(r"radius (\S+) to (\S+) m .* by (\S+) degrees", ran("02_mobile_base").stdout)
    # 0.8 m/s at 1.6 rad/s; each step is a tangent, 0.0016 m long.
    assert (low, high) == (pytest.approx(0.5, abs=0.002), pytest.approx(0.5, abs=0.002))
    assert turned == pytest.approx(np.degrees(1.6 * 1.5), abs=10)


def test_the_pictures_show_and_measure_the_scene(ran):
    printed = ran("03_camera").stdout
    model = mujoco.MjModel.from_xml_path(str(EXAMPLES / "03_camera" / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    eye = data.camera("overview")
    forward = -eye.xmat.reshape(3, 3)[:, 2]
    distance = mujoco.mj_ray(model, data, eye.xpos, forward, None, True, -1, np.zeros(1, np.int32))
    assert numbers(r"in the middle, (\S+) m away", printed) == [pytest.approx(distance, abs=0.01)]


def test_what_the_lidars_see_is_drawn(ran):
    image = cv2.imread(re.search(r"^drawn: (.*)$", ran("04_lidar_scan").stdout, re.MULTILINE)[1])
    assert image.shape == (838, 1400, 3)
    # Half of it is paper, the rest is not.
    assert 0.2 < (image == (28, 22, 18)).all(axis=2).mean() < 0.8


def test_the_figure_eight_is_two_circles_and_its_recording_is_a_page(ran):
    printed = ran("13_view").stdout
    if left_out(printed):
        pytest.skip("the page is not built (make page)")
    driven, left, right, rest = numbers(
        r"drove (\S+) m .*, (\S+) m to the left and (\S+) m to .* ended (\S+) m", printed
    )
    # 1 m/s for 310 odometry messages at 50 Hz; circles of 1 m diameter.
    assert driven == pytest.approx(6.2, abs=0.15)
    assert (left, right) == (pytest.approx(1.0, abs=0.05), pytest.approx(1.0, abs=0.05))
    assert rest < 0.2
    recording = Path(re.search(r"^open it in a browser: (.*)$", printed, re.MULTILINE)[1]).read_text("utf-8")
    assert recording.startswith("<!doctype html>")
    seconds, frames = numbers(r"^figure_eight.html: (\S+) s, (\d+) frames", printed)
    assert seconds == pytest.approx(8.0, abs=1.5)
    assert frames > 8


def test_the_tower_falls_and_stands_again(ran):
    printed = ran("05_free_joints").stdout
    (before,) = numbers(r"the top block is at (\S+) m", printed)
    (fallen,) = numbers(r"after the throw it is at (\S+) m", printed)
    rebuilt, off = numbers(r"it is at (\S+) m, and nothing is more than (\S+) mm off", printed)
    # Five blocks of 60 mm on a table of 100 mm, and half of the sixth; they sink into each other a little.
    assert before == rebuilt == pytest.approx(0.43, abs=0.003)
    assert fallen < 0.2
    assert off < 0.5


def test_the_sign_hangs_where_wind_and_weight_balance(ran):
    found = re.findall(r"^ *(\S+) m/s: a force of +(\S+) N, .* at +(\S+) degrees", ran("06_own_plugin").stdout, re.M)
    assert len(found) == 3
    for speed, force, angle in np.array(found, dtype=float):
        pressure = 0.5 * 1.2 * 1.2 * 0.24 * speed**2
        assert force == pytest.approx(pressure, abs=0.006)
        assert angle == pytest.approx(np.degrees(np.arctan2(pressure, 4.0 * 9.81)), abs=0.05)


def test_the_remote_machine_is_left_out_only_where_there_are_no_namespaces(ran):
    assert left_out(ran("08_remote_machine").stdout) != has_network_namespaces()


def by_hand(name, *arguments, config="config.yaml"):
    """Starts the first server of an example on a free port; returns the process and its endpoint."""
    command = ["-m", "mjplug", "serve", config, "--listen", "tcp/127.0.0.1:0", *arguments]
    server = subprocess.Popen([sys.executable, *command], cwd=EXAMPLES / name, stdout=subprocess.PIPE, text=True)
    return server, re.search(r"^ready · (\S+)", server.stdout.readline())[1]


def stop(server):
    server.send_signal(signal.SIGINT)
    server.communicate(timeout=20)


def test_the_remote_client_runs_by_hand_on_one_machine():
    server, endpoint = by_hand("08_remote_machine")
    try:
        script = EXAMPLES / "08_remote_machine" / "look.py"
        done = subprocess.run([sys.executable, script, endpoint], capture_output=True, text=True, check=False)
    finally:
        stop(server)
    assert done.returncode == 0, done.stderr
    assert f"/mjplug is at {endpoint}, " in done.stdout


@pytest.mark.slow
def test_the_client_of_two_robots_names_the_commands_if_one_server_is_missing():
    server, endpoint = by_hand("07_two_robots", "--set", "namespace=red")
    try:
        done = subprocess.run(
            [sys.executable, EXAMPLES / "07_two_robots" / "drive.py"],
            env=os.environ | {"MJPLUG_CONNECT": endpoint}, capture_output=True, text=True, check=False,
        )  # fmt: skip
    finally:
        stop(server)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "/blue/cmd_vel" in done.stderr
    assert "mjplug serve config.yaml --set namespace=red" in done.stderr


def test_lockstep_is_what_mujoco_does_alone_to_the_last_bit(ran):
    printed = re.search(r"^the last state: (.*)$", ran("09_lockstep").stdout, re.MULTILINE)[1]
    model = mujoco.MjModel.from_xml_path(str(EXAMPLES / "09_lockstep" / "cart_pole.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(400):
        mujoco.mj_step(model, data, 5)
        (cart, pole), (cart_speed, pole_speed) = data.qpos.tolist(), data.qvel.tolist()
        data.ctrl[0] = sum(
            gain * value
            for gain, value in zip((2.0, 3.0, 40.0, 7.0), (cart, cart_speed, pole, pole_speed), strict=True)
        )
    assert [float.fromhex(text) for text in printed.split()] == [*data.qpos, *data.qvel]


def test_the_pole_swings_up_with_forces_that_mujoco_alone_confirms(ran, tmp_path_factory):
    printed = ran("14_swing_up").stdout
    for second, most in ((5, 5.0), (6, 5.0)):
        assert numbers(rf"^t = {second} s: pole +(\S+) degrees", printed)[0] < most
    # It is not lifted at once, but swings.
    assert numbers(r"^t = 1 s: pole +(\S+) degrees", printed)[0] > 90.0
    (file,) = tmp_path_factory.getbasetemp().glob("elsewhere*/forces.txt")
    model = mujoco.MjModel.from_xml_path(str(EXAMPLES / "14_swing_up" / "cart_pole.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    forces = np.loadtxt(file)
    assert len(forces) == 300
    for force in forces:
        data.ctrl[0] = force
        mujoco.mj_step(model, data, 4)
    assert np.cos(data.qpos[1]) > 0.99
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert re.search(r"^digest: (\S+)$", printed, re.MULTILINE)[1] == hashlib.sha256(state.tobytes()).hexdigest()


def test_the_policy_learns_to_balance(ran):
    printed = ran("15_train_a_policy").stdout
    rewards = [float(text) for text in re.findall(r"mean reward +(\S+), best", printed)]
    assert len(rewards) == 8
    assert rewards[0] < 30.0
    assert rewards[-1] > 3.0 * rewards[0]
    mean, worst = numbers(r"^ten new starts: mean reward (\S+) of 150, the worst (\S+)$", printed)
    assert 130.0 < mean <= 150.0
    assert worst > 100.0


def test_a_controller_that_is_too_weak_fails_its_tests(tmp_path):
    folder = shutil.copytree(EXAMPLES / "16_test_of_a_controller", tmp_path / "copied")
    (folder / "controller.py").write_text((folder / "controller.py").read_text().replace("40.0 *", "4.0 *"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_controller.py"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "5 failed, 1 passed" in done.stdout


@pytest.mark.slow
def test_the_picture_of_the_swing_up_is_drawn(tmp_path):
    need_opengl()
    server, endpoint = by_hand("14_swing_up", config="camera.yaml")
    try:
        script = EXAMPLES / "14_swing_up" / "swing_up.py"
        subprocess.run(
            [sys.executable, script, endpoint, "--picture", "picture.png"],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            check=True,
        )
    finally:
        stop(server)
    image = cv2.imread(str(tmp_path / "picture.png"))
    assert image.shape[1] == 1440
    # The orange of the pole, and of its angle.
    orange = (image[..., 2].astype(int) - image[..., 0] > 120).mean(axis=1)
    images, charts = np.array_split(orange, 2)
    assert images.max() > 0.01
    assert charts.max() > 0.01


def test_the_arm_goes_where_the_trajectory_goes(ran):
    printed = ran("10_joint_trajectory").stdout
    for joint, low, high in (("joint1", 0.0, 0.5), ("joint2", -0.6, 0.8)):
        lowest, highest, end = numbers(rf"{joint} went from (\S+) to (\S+) rad, and ends at (\S+)", printed)
        # A stiff servo, which lags by some milliseconds and swings over by a hundredth of the way.
        assert (lowest, highest, end) == (
            pytest.approx(low, abs=0.02),
            pytest.approx(high, abs=0.02),
            pytest.approx(0, abs=0.005),
        )


def test_the_own_message_has_the_definition_of_a_ros_message():
    script = "\n".join((
        "from gripper_msgs import GripperState",
        "from mjplug_schemas.definition import definition",
        "print(definition(GripperState))",
    ))  # fmt: skip
    folder = EXAMPLES / "11_own_message"
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=True)
    fields = [line for line in done.stdout.splitlines() if line and not line.startswith("#")]
    assert fields == [
        "uint8 OPEN=0", "uint8 CLOSED=1", "uint8 BETWEEN=2",
        "std_msgs/Header header", "uint8 state", "float64 opening",
    ]  # fmt: skip
