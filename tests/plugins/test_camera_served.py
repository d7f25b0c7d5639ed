"""`mjplug serve` with cameras: images of a process of their own, as clients see them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from camera_scenes import (
    FLOOR,
    gl,  # noqa: F401 - a fixture
    pixels,
    plane_depth,
    pose,
    scene,
)
from cli.client import Client
from cli.process import STARTING, Served
from mujoco import MjModel

from mjplug.testing import World
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.sensor_msgs import CameraInfo, CompressedImage, Image

EYE = '<camera name="eye" pos="0.3 -0.2 2" euler="35 20 10" resolution="64 48" fovy="70"/>'
XML = scene(EYE, FLOOR)

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


@pytest.fixture
def serve(tmp_path):
    servers = []

    def serve(camera, env=None, *arguments):
        (tmp_path / "scene.xml").write_text(XML)
        (tmp_path / "config.yaml").write_text(f"model: scene.xml\nplugins: {{cameras: {{type: camera, {camera}}}}}\n")
        servers.append(Served("config.yaml", "--paused", *arguments, cwd=tmp_path, env=env))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


def worker_of(server):
    """The id of the server's worker process."""
    (worker,) = server.workers
    return worker


def await_matched(client, *keys):
    """Waits until the server has matched subscribers.

    On a busy machine, Zenoh reports a subscriber to the server later than a request that follows it.
    """
    for key in keys:
        answer = client.send(f"mjplug/interfaces?subscribed={key}").answer()
        assert answer.json == {"key": key, "subscribed": True}


@pytest.mark.usefixtures("gl")
def test_in_lockstep_every_image_arrives_with_its_state_s_time(serve):
    server = serve("sync: true, camera_publish_rate: 10")
    with Client(server.endpoint) as client:
        heard = {
            topic: client.listen(f"cameras/eye/{topic}")
            for topic in ("color", "depth", "camera_info", "color/compressed")
        }
        json = client.listen("cameras/eye/camera_info/@json")
        await_matched(client, *(f"cameras/eye/{topic}" for topic in heard), "cameras/eye/camera_info/@json")
        client.do("mjplug/step_simulation", steps=120)
        for stamp in (100_000_000, 200_000_000):
            color, depth = (Image.from_cdr(heard[t].sample(STARTING).payload.to_bytes()) for t in ("color", "depth"))
            info = CameraInfo.from_cdr(heard["camera_info"].sample().payload.to_bytes())
            jpeg = CompressedImage.from_cdr(heard["color/compressed"].sample().payload.to_bytes())
            assert {m.header.stamp.to_ns() for m in (color, depth, info, jpeg)} == {stamp}
            assert {m.header.frame_id for m in (color, depth, info, jpeg)} == {"eye_frame"}
            expected = plane_depth(info, *pose(World(MjModel.from_xml_string(XML))))
            assert np.abs(pixels(depth) / expected - 1).max() < 1e-3
            assert pixels(color).shape == (48, 64, 3)
        assert json.next()["k"] == pytest.approx(info.k)
    assert server.stop() == 0
    assert "Traceback" not in server.err.text


@pytest.mark.usefixtures("gl")
def test_a_killed_process_is_replaced_and_triggers_continue(serve):
    server = serve("trigger_timeout: 60, eye: {policy: polled}")
    with Client(server.endpoint) as client:
        depth = client.listen("cameras/eye/depth")
        assert client.do("cameras/eye/trigger").endswith("; stamp 0.000000000")
        os.kill(worker_of(server), signal.SIGKILL)
        server.err.wait_for("the process was killed by SIGKILL; it is restarted", STARTING)
        client.do("mjplug/step_simulation", steps=7)
        depth.forget()
        assert client.do("cameras/eye/trigger") == "published depth; stamp 0.014000000"
        assert Image.from_cdr(depth.sample().payload.to_bytes()).header.stamp.to_ns() == 14_000_000
    assert server.stop() == 0


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_in_lockstep_requests_are_answered_while_a_process_is_started_again(serve, number):
    server = serve("sync: true, camera_publish_rate: 10, job_timeout: 2")
    with Client(server.endpoint) as client:
        color = client.listen("cameras/eye/color")
        await_matched(client, "cameras/eye/color")
        client.do("mjplug/step_simulation", steps=50)
        color.sample(STARTING)
        os.kill(worker_of(server), number)
        steps = client.request("mjplug/step_simulation", steps=100)
        # The images of the next 0.2 s come late, if at all; until then, everything else is answered.
        for _ in range(20):
            assert client.ask("mjplug/set_pause", paused=True)["success"] is True
        # Pausing cancels a running step_simulation.
        steps.answer(STARTING)
        server.err.wait_for("it is restarted in 0.5 s", STARTING)
        color.forget()
        client.do("mjplug/set_pause", paused=False)
        color.sample(STARTING)
    assert server.stop() == 0
    assert "Traceback" not in server.err.text


@pytest.fixture
def stuck():
    """Starts a process with clients that do not read."""
    clients = []

    def stuck(endpoint, count):
        command = [sys.executable, str(Path(__file__).parent / "stuck_subscriber.py"), endpoint, str(count)]
        clients.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return clients[-1]

    yield stuck
    for client in clients:
        client.kill()
        client.communicate()


@pytest.mark.usefixtures("gl")
def test_clients_that_do_not_read_delay_neither_physics_nor_other_clients_nor_the_end(serve, stuck):
    server = serve("camera_publish_rate: 20, eye: {width: 640, height: 480}")
    with Client(server.endpoint) as client:
        depth, clock = client.listen("cameras/eye/depth"), client.listen("clock")
        slow = stuck(server.endpoint, 4)
        client.do("mjplug/set_pause", paused=False)
        assert slow.stdout.readline() == "stuck\n"
        # More than the links can hold.
        for _ in range(20):
            depth.sample(STARTING)
        clock.forget()
        first, began = time_of(clock.sample()), time.monotonic()
        for _ in range(40):
            depth.sample(STARTING)
        elapsed = time.monotonic() - began
        ticks = [time_of(clock.sample()) for _ in range(clock._samples.qsize())]
        # If physics waited for a link, it would be slower by far. A busy machine slows it too.
        assert ticks[-1] - first > 0.2 * elapsed
        # 100 Hz
        assert len(ticks) > 90 * (ticks[-1] - first)
        assert slow.poll() is None
    assert server.stop() == 0


def time_of(sample):
    return Clock.from_cdr(sample.payload.to_bytes()).clock.to_ns() / 1e9


def test_without_opengl_the_server_runs_on_and_refuses_triggers(serve):
    # As where the driver is missing.
    server = serve("eye: {policy: polled}", {"MUJOCO_GL": "egl", "__EGL_VENDOR_LIBRARY_DIRS": "/nowhere"})
    server.err.wait_for(
        "the work is unavailable on this machine: .* EGL .apt-get install libegl1 libgl1.*; "
        "the server continues without it",
        STARTING,
    )
    with Client(server.endpoint) as client:
        answer = client.ask("cameras/eye/trigger")
        assert not answer["success"]
        assert "no OpenGL through EGL (apt-get install libegl1 libgl1): " in answer["message"]
        client.do("mjplug/step_simulation", steps=10)
    assert server.stop() == 0
    assert server.err.text.count("warning") == 1
    assert "Traceback" not in server.err.text
