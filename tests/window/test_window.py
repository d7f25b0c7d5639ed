"""The window itself, on a virtual screen, with the keyboard and the mouse of that screen."""

import os
import signal
import subprocess
import sys
import threading
import time

import mujoco
import pytest
from machine import need_program
from services.view_packs import Frame

from mjplug import open_server

BOX = """
<mujoco><worldbody><light pos="0 0 3"/><geom type="plane" size="3 3 .1" rgba=".6 .7 .8 1"/>
  <body name="box" pos="0 0 .3"><freejoint/><geom type="box" size=".3 .3 .3" rgba=".9 .4 .1 1"/></body>
</worldbody></mujoco>
"""
PROGRAM = """
import sys
from mjplug.client import connect
from mjplug.window import run_window
with connect(sys.argv[1], timeout=60) as client:
    run_window(client)
"""
ANSWER_TIMEOUT = 90.0


class Screen:
    """A virtual screen."""

    def __init__(self, folder):
        read, write = os.pipe()
        command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
        with (folder / "screen.txt").open("wb") as log:
            self._server = subprocess.Popen(command, pass_fds=(write,), stdout=log, stderr=log)
        os.close(write)
        with os.fdopen(read) as pipe:
            self.environment = {**os.environ, "DISPLAY": f":{pipe.readline().strip()}", "LIBGL_ALWAYS_SOFTWARE": "1"}

    def act(self, *words):
        """Runs xdotool."""
        subprocess.run(["xdotool", *words], env=self.environment, check=True, timeout=ANSWER_TIMEOUT)

    def close(self):
        self._server.terminate()
        self._server.wait()


@pytest.fixture
def screen(tmp_path):
    need_program("Xvfb", "xvfb")
    need_program("xdotool", "xdotool")
    opened = Screen(tmp_path)
    yield opened
    opened.close()


@pytest.fixture
def server(tmp_path):
    scene = tmp_path / "box.xml"
    scene.write_text(BOX)
    with open_server(scene, paused=True) as opened:
        yield opened


@pytest.fixture
def window(screen, server, tmp_path):
    """A process with the window of the server."""
    log = (tmp_path / "window.txt").open("wb")
    command = [sys.executable, "-c", PROGRAM, server.endpoint]
    process = subprocess.Popen(command, env=screen.environment, stdout=log, stderr=log)
    yield process
    process.kill()
    process.wait()
    log.close()


class Frames:
    """The newest frame of the server: pause, resets, steps and the position of the box."""

    def __init__(self, session):
        self._arrived = threading.Condition()
        self._newest = None
        self._subscriber = session.declare_subscriber("mjplug/@view/frame", self._receive)

    def wait_for(self, condition, within):
        """Returns whether the newest frame met a condition in time."""
        with self._arrived:
            return self._arrived.wait_for(lambda: self._newest is not None and condition(self._newest), within)

    def _receive(self, sample):
        with self._arrived:
            self._newest = Frame(bytes(sample.payload))
            self._arrived.notify_all()


def do_until(act, condition, frames, process):
    """Acts in the window until a frame meets a condition: the window may not be there yet, or may miss a key."""
    end = time.monotonic() + ANSWER_TIMEOUT
    while True:
        act()
        if frames.wait_for(condition, 10.0):
            return
        assert process.poll() is None
        assert time.monotonic() < end


@pytest.mark.slow
@pytest.mark.skipif(int(mujoco.__version__.split(".")[0]) > 3, reason="Studio draws too slowly without a graphics card")
def test_keys_and_mouse_of_the_window_act_on_the_server(screen, server, window):
    with server.client() as client:
        frames = Frames(client.session)
        screen.act("mousemove", "266", "200")
        do_until(lambda: screen.act("key", "space"), lambda frame: not frame.flags, frames, window)
        do_until(lambda: screen.act("key", "space"), lambda frame: frame.flags, frames, window)
        do_until(lambda: screen.act("key", "BackSpace"), lambda frame: frame.epoch > 0, frames, window)
        do_until(lambda: screen.act("key", "Right"), lambda frame: frame.step > 0, frames, window)
        do_until(lambda: screen.act("key", "space"), lambda frame: not frame.flags, frames, window)

        def lift():
            screen.act("mousemove", "266", "200")
            screen.act("click", "--repeat", "2", "--delay", "80", "1")
            time.sleep(1.0)
            screen.act("keydown", "ctrl")
            screen.act("mousedown", "3")
            for _ in range(15):
                screen.act("mousemove_relative", "--", "0", "-10")
                time.sleep(0.1)

        def let_go():
            screen.act("mouseup", "3", "keyup", "ctrl")

        do_until(lambda: (let_go(), lift()), lambda frame: frame.bodies[0, 2] > 0.34, frames, window)
        do_until(let_go, lambda frame: frame.bodies[0, 2] < 0.31, frames, window)
        window.send_signal(signal.SIGINT)
        assert window.wait(ANSWER_TIMEOUT) == -signal.SIGINT
