"""`mjplug record` and `mjplug play` as programs: signals, terminals, disks and other servers."""

import contextlib
import itertools
import os
import pty
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from cli.process import COMMAND, STARTING, Lines, Served, environment, run
from hostile.full_disk import permitted
from recording.readers import by_rosbags
from recording.test_bags import new_bag, told

from mjplug.bag.reader import Bag
from mjplug.bag.repair import check

TIMEOUT = 60.0


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    served = Served(
        "bundled:arm", "--plugin", "joint_state_publisher", "--plugin", "robot_description",
        cwd=tmp_path_factory.mktemp("server"),
    )  # fmt: skip
    yield served
    assert served.stop() == 0


class Running:
    """A command that runs until it is stopped."""

    def __init__(self, server, folder, *words, command=COMMAND):
        self.process = subprocess.Popen(
            [*command, *words], cwd=folder, env=environment({"MJPLUG_CONNECT": server.endpoint}),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)

    def stop(self, number=signal.SIGINT):
        self.process.send_signal(number)
        code = self.process.wait(TIMEOUT)
        self.out.wait_for_end()
        self.err.wait_for_end()
        return code


@pytest.fixture
def start(server, tmp_path):
    running = []

    def start(*words, **options):
        running.append(Running(server, tmp_path, *words, **options))
        return running[-1]

    yield start
    for one in running:
        if one.process.poll() is None:
            one.process.kill()
            one.process.wait()


def grown(path, size):
    """Waits until a file is larger than a size."""
    until = time.monotonic() + TIMEOUT
    while not (path.exists() and path.stat().st_size > size):
        assert time.monotonic() < until, path
        time.sleep(0.05)


def test_ctrl_c_completes_the_bag_and_what_never_came_is_named(start, tmp_path):
    recorder = start("record", "/joint_states", "/robot_description", "/joint_state", "-o", "bag")
    assert recorder.out.wait_for("recording into bag; Ctrl-C ends it", STARTING)
    named = recorder.err.wait_for("no server has the topic", TIMEOUT).string
    # A busy server may answer too late to suggest a name.
    assert re.fullmatch(
        r"warning: no server has the topic /joint_state(, did you mean '/joint_states'\?)?; "
        r"it is recorded if one appears\n",
        named,
    )
    grown(tmp_path / "bag" / "bag_0.mcap", 2000)
    assert recorder.stop() == 0
    assert re.search(r"recorded \d+ messages of 2 topics in bag \(\d[\d.]* .?B, 1 file\)", recorder.out.text)
    assert "warning: /joint_state: no server had this topic" in recorder.err.text
    assert "Traceback" not in recorder.err.text
    assert list(check(Bag(tmp_path / "bag"))) == []
    read = by_rosbags(tmp_path / "bag")
    assert {message.topic for message in read} == {"/joint_states", "/robot_description"}
    times = [message.log_time for message in read if message.topic == "/joint_states"]
    # Each message of 100 Hz, at its simulated time.
    assert {b - a for a, b in itertools.pairwise(times[1:])} == {10_000_000}


def test_a_recorder_that_is_killed_leaves_what_was_flushed(start, tmp_path):
    recorder = start("record", "--all", "-o", "bag")
    grown(tmp_path / "bag" / "bag_0.mcap", 10_000)
    recorder.process.kill()
    recorder.process.wait()
    problems = run("bag", "check", "bag", cwd=tmp_path)
    assert problems.returncode == 1
    assert "was not completed" in problems.stderr
    done = run("bag", "recover", "bag", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    read = by_rosbags(tmp_path / "bag_recovered")
    assert len(read) > 50
    assert done.stdout == f"wrote {tmp_path / 'bag_recovered'} with {len(read)} messages\n"


def test_a_recording_without_topics_or_into_a_taken_folder_is_refused(server, tmp_path):
    connect = {"MJPLUG_CONNECT": server.endpoint}
    done = run("record", cwd=tmp_path, env=connect)
    assert (done.returncode, "name topics, or give --all or --regex" in done.stderr) == (2, True)
    (tmp_path / "taken").mkdir()
    done = run("record", "-a", "-o", "taken", cwd=tmp_path, env=connect)
    assert (done.returncode, done.stderr) == (
        1, "error: taken already exists; choose another name with --output, or remove it\n",
    )  # fmt: skip


def test_a_playback_plays_to_the_end_and_refuses_to_fight_a_server(server, tmp_path):
    bag = new_bag(tmp_path / "bag")
    for number in range(20):
        bag.write(told(number, number * 0.01))
    bag.finish()
    done = run("play", "bag", "--listen", "tcp/127.0.0.1:0", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"playing 1 topic of bag at tcp/127.0.0.1:\d+\nplayed 20 messages\n", done.stdout)
    words = ("play", "bag", "-m", "/told:=/joint_states")
    done = run(*words, cwd=tmp_path, env={"MJPLUG_CONNECT": server.endpoint})
    assert done.returncode == 1
    assert done.stderr.startswith("error: /mjplug publishes /joint_states: ")
    for words, code, why in (
        (("play", "bag", "--topics", "/tolt"), 1, "did you mean '/told'"),
        (("play", "bag", "-m", "told"), 2, "another form than /a:=/b"),
        (("play", "no_bag"), 1, "there is no bag no_bag"),
    ):
        done = run(*words, cwd=tmp_path)
        assert (done.returncode, why in done.stderr) == (code, True), done.stderr


def test_ctrl_c_ends_a_playback(start, tmp_path):
    bag = new_bag(tmp_path / "bag")
    bag.write(told(0, 0.0))
    bag.write(told(1, 1000.0))
    bag.finish()
    playing = start("play", "bag")
    assert playing.out.wait_for("playing 1 topic", STARTING)
    assert playing.stop() == 130
    # The signal may come before the first message.
    assert re.search(r"played [01] messages?; stopped before the end\n$", playing.out.text)
    assert "Traceback" not in playing.err.text


class Terminal:
    """A command at a terminal."""

    def __init__(self, server, folder, *words):
        self.mine, theirs = pty.openpty()
        self.process = subprocess.Popen(
            ["setsid", "--ctty", *COMMAND, *words], stdin=theirs, stdout=theirs, stderr=theirs, cwd=folder,
            env=environment({"MJPLUG_CONNECT": server.endpoint}),
        )  # fmt: skip
        os.close(theirs)
        os.set_blocking(self.mine, False)
        self.text = ""

    def press(self, text):
        os.write(self.mine, text.encode())

    def shows(self, pattern):
        """Waits until the output contains a pattern; forgets what comes before its end."""
        until = time.monotonic() + STARTING
        while not (found := re.search(pattern, self.text)):
            assert time.monotonic() < until, f"no {pattern!r} in {self.text!r}"
            with contextlib.suppress(BlockingIOError):
                self.text += os.read(self.mine, 4096).decode()
                continue
            time.sleep(0.01)
        self.text = self.text[found.end() :]
        return found

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.mine)


def test_at_a_terminal_the_space_key_pauses_and_a_line_shows_the_progress(server, tmp_path):
    terminal = Terminal(server, tmp_path, "record", "/joint_states", "-o", "bag", "--start-paused")
    try:
        terminal.shows("recording into bag; Ctrl-C ends it; paused")
        terminal.shows(r"\d+ s  0 messages  0 B")
        terminal.press(" ")
        terminal.shows(r"recording\r\n")
        terminal.shows(r"\d+ s  [1-9]\d* messages  [\d.]+ .?B  [\d.]+ .?B/s  lost 0  dropped 0  waiting 0 B  file 1")
        terminal.press(" ")
        terminal.shows(r"paused\r\n")
        terminal.press("\x03")
        terminal.shows(r"recorded \d+ messages of 1 topics? in bag")
        assert terminal.process.wait(TIMEOUT) == 0
    finally:
        terminal.close()
    assert list(check(Bag(tmp_path / "bag"))) == []


ON_A_SMALL_DISK = """
import os, subprocess, sys
from pathlib import Path
disk, keep = Path(sys.argv[1]), Path(sys.argv[2])
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=160k", "tmpfs", disk], check=True)
done = subprocess.run([sys.executable, "-m", "mjplug", "record", "-a", "-o", disk / "bag", "--duration", "60",
    "--compression", "none"], text=True, capture_output=True)
print(done.stdout, done.stderr, sep="")
checked = subprocess.run([sys.executable, "-m", "mjplug", "bag", "check", disk / "bag"], text=True, capture_output=True)
print(checked.stdout, checked.stderr, sep="")
subprocess.run(["cp", "-r", disk / "bag", keep], check=True)
sys.exit(done.returncode)
"""


@pytest.mark.slow
@pytest.mark.skipif(permitted() is not None, reason=str(permitted()))
def test_a_disk_that_fills_up_leaves_a_whole_bag(server, tmp_path):
    with tempfile.TemporaryDirectory() as disk:
        done = subprocess.run(
            ["unshare", "-m", sys.executable, "-c", ON_A_SMALL_DISK, disk, str(tmp_path)],
            env=environment({"MJPLUG_CONNECT": server.endpoint}),
            text=True, capture_output=True, timeout=150, check=False,
        )  # fmt: skip
    assert done.returncode == 1, done
    assert f"error: the disk of {disk}/bag is full" in done.stdout
    assert "ok · 1 file, " in done.stdout
    assert "Traceback" not in done.stdout
    size = sum(path.stat().st_size for path in Path(tmp_path / "bag").iterdir())
    assert 90_000 < size < 160 * 1024
    assert len(by_rosbags(tmp_path / "bag")) > 100
