"""Image rate compared with plain MuJoCo calls, and lateness of physics while a camera renders."""

import logging
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import mujoco
import numpy as np
import zenoh

from benchmarks.frame_publisher import FramePublisher
from benchmarks.lateness import p99_in_thread
from benchmarks.measure import Result, pairs
from benchmarks.world import client, model_of, network
from mjplug.config.settings import Settings
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Job
from mjplug.plugin.selection import Selected
from mjplug.server.server import Server
from mjplug.wire.session import SessionSettings
from mjplug.worker.pool import ProcessWorkerPool
from mjplug_plugins.camera import Camera
from mjplug_plugins.camera.gl import BACKEND_VARIABLE, GlContext
from mjplug_plugins.camera.view import View, camera_names, intrinsics_of
from mjplug_plugins.camera.work import CameraWork, RenderOptions, stream_task

WIDTH, HEIGHT = 640, 480

FRAMES = 0.5
"""Wall time of one measurement of images [s]."""

SECONDS, PERIOD, RATE = 4.0, 0.001, 30.0
"""Duration of one measurement [s], physics time step [s], and image rate of the camera [Hz]."""

TOPICS = ("color", "depth", "camera_info")


def results() -> list[Result]:
    """Measures rendering in a separate process, as in the server, then physics while a camera renders."""
    # MuJoCo reads the variable when it is imported, so a new process is needed.
    os.environ[BACKEND_VARIABLE] = os.environ.setdefault("MUJOCO_GL", "egl")
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        rendered = [
            result for uri in ("bundled:arm", "bundled:quadruped") for result in pool.submit(_rendered, uri).result()
        ]
    return [*rendered, *_beside_physics("bundled:arm")]


def _rendered(uri: str) -> list[Result]:
    kinds: list[tuple[str, Callable[[str], Any], str]] = [
        ("a bare loop of mjr_render and mjr_readPixels", _Bare, ">= 0.85"),
        ("mujoco.Renderer with its defaults", _Renderer, ">= 4"),
    ]
    ours, name = _Ours(uri), uri.partition(":")[2]
    rows = []
    for other_name, kind, goal in kinds:
        other = kind(uri)
        what = f"images/s, {name}, 640x480 colour and depth, against {other_name}"
        rows.append(pairs(what, lambda: _rate(ours), lambda other=other: _rate(other), goal, "{:.0f}/s", 9))
        other.close()
    ours.close()
    return rows


def _rate(drawing: "_Ours | _Bare | _Renderer") -> float:
    drawing.begin()
    drawing.draw()
    began, count = perf_counter(), 0
    while perf_counter() - began < FRAMES:
        drawing.draw()
        count += 1
    return count / (perf_counter() - began)


class _Scenes:
    """A model that alternates between two states, so that consecutive images differ."""

    def __init__(self, uri: str) -> None:
        self.model = model_of(uri)
        self._states = []
        for turn in (0.0, 0.05):
            data = mujoco.MjData(self.model)
            if self.model.nkey:
                mujoco.mj_resetDataKeyframe(self.model, data, self.model.nkey - 1)
            mujoco.mj_integratePos(self.model, data.qpos, np.full(self.model.nv, turn), 1.0)
            mujoco.mj_forward(self.model, data)
            self._states.append(data)

    @property
    def next(self) -> mujoco.MjData:
        self._states.reverse()
        return self._states[0]


class _Ours:
    """The work of the camera plugin, without the network."""

    def __init__(self, uri: str) -> None:
        self._scenes = _Scenes(uri)
        model = self._scenes.model
        name, camera = next(iter(camera_names(model).items()))
        view = View(name, name, camera, WIDTH, HEIGHT, "frame", intrinsics_of(model, camera, WIDTH, HEIGHT), "none")
        self._work = CameraWork([view], RenderOptions())
        self._work.open(
            model, [FramePublisher(matched) for matched in (True, True, True, False, False)], logging.getLogger()
        )
        self._job = Job(0, 0, frozenset([stream_task(name)]))

    def begin(self) -> None:
        """Does nothing: every job makes the context current."""

    def draw(self) -> None:
        self._work.perform(self._scenes.next, self._job)

    def close(self) -> None:
        self._work.close()


class _Bare:
    """The minimal MuJoCo calls for colour and depth, with the visual settings of `quality: fast`."""

    def __init__(self, uri: str) -> None:
        self._scenes = _Scenes(uri)
        model = self._scenes.model
        model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self._gl = GlContext(WIDTH, HEIGHT)
        self._context = mujoco.MjrContext(model, int(mujoco.mjtFontScale.mjFONTSCALE_50))
        mujoco.mjr_setBuffer(int(mujoco.mjtFramebuffer.mjFB_OFFSCREEN), self._context)
        scene = mujoco.MjvScene(model, 2000)
        flags = mujoco.mjtRndFlag
        scene.flags[[int(flags.mjRND_SHADOW), int(flags.mjRND_REFLECTION), int(flags.mjRND_HAZE)]] = 0
        options = mujoco.MjvOption()
        options.sitegroup[:] = 0
        options.flags[int(mujoco.mjtVisFlag.mjVIS_RANGEFINDER)] = 0
        camera = mujoco.MjvCamera()
        camera.type, camera.fixedcamid = int(mujoco.mjtCamera.mjCAMERA_FIXED), 0
        self._scene = scene
        self._view = options, None, camera, int(mujoco.mjtCatBit.mjCAT_ALL), scene
        self._rect = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
        self._colour = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        self._depth = np.empty((HEIGHT, WIDTH), np.float32)

    def begin(self) -> None:
        self._gl.make_current()

    def draw(self) -> None:
        mujoco.mjv_updateScene(self._scenes.model, self._scenes.next, *self._view)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._colour, self._depth, self._rect, self._context)

    def close(self) -> None:
        self._gl.make_current()
        self._context.free()
        self._gl.close()


class _Renderer:
    """`mujoco.Renderer`, as in MuJoCo's tutorial."""

    def __init__(self, uri: str) -> None:
        self._scenes = _Scenes(uri)
        model = self._scenes.model
        model.vis.global_.offwidth = max(WIDTH, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(HEIGHT, model.vis.global_.offheight)
        self._renderer = mujoco.Renderer(model, HEIGHT, WIDTH)

    def begin(self) -> None:
        """Does nothing: the renderer makes its context current."""

    def draw(self) -> None:
        self._renderer.update_scene(self._scenes.next, camera=0)
        self._renderer.render()
        self._renderer.enable_depth_rendering()
        self._renderer.render()
        self._renderer.disable_depth_rendering()

    def close(self) -> None:
        self._renderer.close()


def _beside_physics(uri: str) -> list[Result]:
    """Lateness and real-time factor of 1 kHz physics, with a camera that another process subscribes to."""
    factors: list[float] = []
    images: list[int] = []
    with served(uri) as (server, endpoint), Listener(endpoint) as listener:

        def run(listening: bool) -> float:
            def work(late: list[float]) -> None:
                if listening:
                    listener.begin()
                factor = run_for_a_while(server, late)
                if listening:
                    factors.append(factor)
                    images.append(listener.end())

            return p99_in_thread(work)

        what = "p99 lateness of a step at 1 kHz with a 30 Hz 640x480 camera, against no subscriber (5 x 4 s)"
        late = pairs(what, lambda: run(True), lambda: run(False), "<= 3", "{:.0f} µs", repeats=5)
    # The worker process starts in the first turn.
    what = "real-time factor at 1 kHz with a 30 Hz 640x480 camera"
    factor, rate = float(np.median(factors[1:])), float(np.median(images[1:])) / len(TOPICS) / SECONDS
    received = f"{rate:.1f} images/s received"
    return [late, Result(what, f"{factor:.4f}", received, factor, min(factors[1:]), max(factors[1:]), ">= 0.995")]


def run_for_a_while(server: Server, late: list[float]) -> float:
    """Runs physics in real time for `SECONDS`; returns the real-time factor."""
    loop = server.loop
    first = loop.simulation.step
    steps = round(SECONDS / PERIOD)
    timer = loop.scheduler.every(
        loop.simulation.time.steps_per(PERIOD),
        lambda: late.append(perf_counter() - loop.pacer.deadline(loop.simulation.step)),
        first,
    )
    loop.last_step = first + steps
    began = perf_counter()
    loop.run()
    elapsed = perf_counter() - began
    timer.cancel()
    return steps * PERIOD / elapsed


@contextmanager
def served(uri: str) -> Iterator[tuple[Server, str]]:
    """Starts a server with the cameras of a model in this process; yields the server and its endpoint."""
    model = model_of(uri)
    model.opt.timestep = PERIOD
    settings = Settings.model_validate({"model": uri, "sim": {"speed": 1.0}})
    selected = Selected("cameras", Camera, Camera.parameters_type(camera_publish_rate=RATE))
    with network() as opened:
        workers = ProcessWorkerPool(SessionSettings(listen=("tcp/127.0.0.1:0",)), opened.session.endpoints)
        try:
            simulation = Simulation(model, model.key(0).name if model.nkey else "")
            yield Server(settings, simulation, opened, [selected], workers), opened.session.endpoint
        finally:
            workers.close()


class Listener:
    """A client in another process that subscribes between `begin` and `end`."""

    def __init__(self, endpoint: str) -> None:
        command = [sys.executable, "-m", "benchmarks.camera", endpoint]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __enter__(self) -> "Listener":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def begin(self) -> None:
        """Subscribes and counts messages."""
        self._ask()

    def end(self) -> int:
        """Unsubscribes and returns the number of received messages."""
        return int(self._ask())

    def _ask(self) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return self._process.stdout.readline()


def _listen(endpoint: str) -> None:
    """The program of the other process: each line on standard input starts or ends the subscription."""
    with client(endpoint) as session:
        while sys.stdin.readline():
            messages: list[int] = []

            def count(sample: zenoh.Sample, messages: list[int] = messages) -> None:
                messages.append(len(sample.payload))

            subscribers = [session.declare_subscriber(f"cameras/camera/{topic}", count) for topic in TOPICS]
            print("listening", flush=True)
            sys.stdin.readline()
            for subscriber in subscribers:
                subscriber.undeclare()
            print(len(messages), flush=True)


if __name__ == "__main__":
    _listen(sys.argv[1])
