"""`mjplug teleop`: keys of a terminal drive a base, and every end stops it."""

import contextlib
import os
import pty
import re
import signal
import subprocess
import termios
import time

import pytest
from cli.client import Client
from cli.process import COMMAND, STARTING, Served, environment

from mjplug.cli.teleop_keys import DIRECTIONS, SPEEDS, Drive, keys
from mjplug_schemas.geometry_msgs import TwistStamped

BASE = (
    "bundled:mobile_base", "--plugin", "base_velocity", "--set", "plugins.base_velocity.body=base_link",
    "--plugin", "free_joint_state_publisher:base",
)  # fmt: skip


# As in teleop_twist_keyboard of ROS 2, on which users have learnt the keys.
@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        ("i", (0.5, 0, 0, 0)), (",", (-0.5, 0, 0, 0)), ("j", (0, 0, 0, 1)), ("l", (0, 0, 0, -1)),
        ("u", (0.5, 0, 0, 1)), ("o", (0.5, 0, 0, -1)), ("m", (-0.5, 0, 0, -1)), (".", (-0.5, 0, 0, 1)),
        ("I", (0.5, 0, 0, 0)), ("<", (-0.5, 0, 0, 0)), ("J", (0, 0.5, 0, 0)), ("L", (0, -0.5, 0, 0)),
        ("U", (0.5, 0.5, 0, 0)), ("O", (0.5, -0.5, 0, 0)), ("M", (-0.5, 0.5, 0, 0)), (">", (-0.5, -0.5, 0, 0)),
        ("t", (0, 0, 0.5, 0)), ("b", (0, 0, -0.5, 0)), ("k", (0, 0, 0, 0)), (" ", (0, 0, 0, 0)), ("", (0, 0, 0, 0)),
    ],
)  # fmt: skip
def test_keys_move_as_those_of_teleop_twist_keyboard(key, velocity):
    drive = Drive(0.5, 1.0, (1, 1, 1, 1))
    drive.press(key)
    assert drive.velocity == velocity
    assert len(DIRECTIONS) == 18


def test_speed_keys_change_the_speeds_by_a_tenth_and_keep_the_direction():
    drive = Drive(0.5, 1.0)
    drive.press("u")
    for key in "qwe":
        drive.press(key)
    assert drive.velocity == pytest.approx((0.5 * 1.21, 0, 0, 1.21))
    for key in "zxc":
        drive.press(key)
    assert drive.velocity == pytest.approx((0.5 * 1.21 * 0.81, 0, 0, 1.21 * 0.81))
    assert not set(SPEEDS) & set(DIRECTIONS)


def test_escape_sequences_are_one_key_so_that_their_letters_do_not_move_the_robot():
    assert keys("i\x1b[A\x1b[B\x1b[C\x1bOD") == ["i", "i", ",", "l", "j"]
    assert keys("\x1b[15~\x1b[1;5i\x1bi\x1b") == ["", "", "", ""]
    assert keys("\x1b[Z") == [""]
    assert keys("ki") == ["k", "i"]


class Teleop:
    """The command at a terminal."""

    def __init__(self, *arguments):
        self.mine, self.theirs = pty.openpty()
        self.before = termios.tcgetattr(self.theirs)
        # Only for a controlling terminal, Ctrl-C becomes a signal.
        self.process = subprocess.Popen(
            ["setsid", "--ctty", *COMMAND, "teleop", *arguments],
            stdin=self.theirs, stdout=self.theirs, stderr=self.theirs, env=environment(),
        )  # fmt: skip
        os.set_blocking(self.mine, False)
        self.text = ""

    def press(self, text):
        os.write(self.mine, text.encode())

    def shows(self, pattern, within=STARTING):
        """Waits until the output contains a pattern; forgets what comes before its end."""
        until = time.monotonic() + within
        while not (found := re.search(pattern, self.text)):
            assert time.monotonic() < until, f"no {pattern!r} in {self.text!r}"
            with contextlib.suppress(BlockingIOError):
                self.text += os.read(self.mine, 4096).decode()
                continue
            time.sleep(0.01)
        self.text = self.text[found.end() :]
        return found

    def exit_code(self, within=STARTING):
        code = self.process.wait(within)
        self.restored()
        return code

    def restored(self):
        assert termios.tcgetattr(self.theirs) == self.before

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.mine)
        os.close(self.theirs)


@pytest.fixture
def teleop():
    started = []

    def teleop(*arguments):
        started.append(Teleop(*arguments))
        return started[-1]

    yield teleop
    for one in started:
        one.close()


class Base:
    """A base that moves, and the commands that it gets."""

    def __init__(self, server, client):
        self.endpoint = server.endpoint
        self._states = client.listen("base/free_joint_states/@json")
        self.commands = client.listen("base_velocity/cmd_vel")

    def state(self):
        """The next pose and velocity."""
        self._states.forget()
        return self._states.next()["free_joints"][0]

    def wait_for_speed(self, test, within=STARTING):
        """Waits until the velocity along the world's x axis passes a test."""
        until = time.monotonic() + within
        while not test(vx := self.state()["twist"]["twist"]["linear"]["x"]):
            assert time.monotonic() < until, vx


@pytest.fixture(scope="module")
def based(tmp_path_factory):
    server = Served(*BASE, cwd=tmp_path_factory.mktemp("base"))
    with Client(server.endpoint) as client:
        yield Base(server, client)
    server.kill()


@pytest.fixture
def base(based):
    based.wait_for_speed(lambda vx: abs(vx) < 0.01)
    return based


def test_keys_move_the_base_and_it_stops_when_the_key_is_released(base, teleop):
    command = teleop("-e", base.endpoint, "--speed", "0.4", "--key-timeout", "1.0")
    command.shows(r"Publishing geometry_msgs/msg/Twist on /base_velocity/cmd_vel")
    command.shows(r"speed 0\.4 m/s, turn 1 rad/s: stopped")
    before = base.state()["pose"]["pose"]["position"]["x"]
    command.press("i")
    command.shows(r"x \+0\.4")
    base.wait_for_speed(lambda vx: vx > 0.35)
    # No key follows, as after a release.
    command.shows(r": stopped")
    base.wait_for_speed(lambda vx: abs(vx) < 0.01)
    assert base.state()["pose"]["pose"]["position"]["x"] > before + 0.1
    command.press("\x03")
    assert command.exit_code() == 130


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 130), (signal.SIGQUIT, 130)]
)
def test_a_signal_stops_the_base_and_restores_the_terminal(base, teleop, number, code):
    command = teleop("-e", base.endpoint, "--key-timeout", "0", "--speed", "0.3")
    command.shows(": stopped")
    command.press("i")
    base.wait_for_speed(lambda vx: vx > 0.25)
    base.commands.forget()
    command.process.send_signal(number)
    assert command.exit_code() == code
    # Zero is published; the base does not wait for its timeout.
    last = None
    with contextlib.suppress(AssertionError):
        while True:
            last = base.commands.sample(0.5).payload.to_bytes()
    assert last is not None
    assert last[4:] == bytes(48)
    base.wait_for_speed(lambda vx: abs(vx) < 0.01)


def test_ctrl_z_stops_the_base_and_gives_the_terminal_back_until_it_continues(base, teleop):
    command = teleop("-e", base.endpoint, "--key-timeout", "0")
    command.shows(": stopped")
    command.press("i")
    base.wait_for_speed(lambda vx: vx > 0.45)
    command.process.send_signal(signal.SIGTSTP)
    _, status = os.waitpid(command.process.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status)
    command.restored()
    base.wait_for_speed(lambda vx: abs(vx) < 0.01)
    command.process.send_signal(signal.SIGCONT)
    command.shows(": stopped")
    command.press(",")
    base.wait_for_speed(lambda vx: vx < -0.45)
    command.press("\x1b[15~")
    base.wait_for_speed(lambda vx: abs(vx) < 0.01)
    command.process.send_signal(signal.SIGINT)
    assert command.exit_code() == 130


def test_without_a_terminal_it_says_so(base, cli):
    result = cli("teleop", "-e", base.endpoint)
    assert result.returncode == 1
    assert result.stderr.startswith("error: teleop reads keys from a terminal, but standard input is none; ")


def test_a_topic_of_another_type_is_refused(base, teleop):
    command = teleop("/clock", "-e", base.endpoint)
    command.shows("error: topic /clock is rosgraph_msgs/msg/Clock, not geometry_msgs/msg/Twist or ")
    assert command.exit_code() == 2
    command = teleop("/elsewhere", "-e", base.endpoint)
    command.shows("for a topic of another program, add --stamped or --no-stamped")
    assert command.exit_code() == 1


def test_a_stamped_topic_gets_the_simulated_time(serve, teleop):
    server = serve(
        *BASE,
        "--set",
        "plugins.base_velocity.use_stamped_twist=true",
        "--set",
        "plugins.base_velocity.cmd_vel_topic=/go",
    )
    with Client(server.endpoint) as client:
        commands = client.listen("go")
        command = teleop("-e", server.endpoint, "--frame-id", "base_link", "--speed", "0.25")
        command.shows(r"Publishing geometry_msgs/msg/TwistStamped on /go")
        command.shows(": stopped")
        command.press("J")
        message = TwistStamped.from_cdr(commands.sample(STARTING).payload.to_bytes())
        assert message.header.frame_id == "base_link"
        assert message.twist.linear.y == 0.25
        assert message.header.stamp.sec + message.header.stamp.nanosec > 0
        command.process.send_signal(signal.SIGINT)
        assert command.exit_code() == 130


def test_without_a_topic_to_drive_it_names_the_plugin(serve, teleop):
    command = teleop("-e", serve("bundled:box").endpoint)
    command.shows(r"error: no server subscribes to a topic of geometry_msgs/msg/Twist or .*`base_velocity` does")
    assert command.exit_code() == 1
