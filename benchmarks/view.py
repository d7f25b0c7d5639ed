"""The view: what it costs physics, the worker process, the relay and the link, and how fast it answers."""

import gzip
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter

import mujoco
import zenoh

import mjplug
from benchmarks import force_probe
from benchmarks.measure import Result, figure, pairs
from benchmarks.meshed_robot import meshed_robot
from benchmarks.page import page
from benchmarks.round_trip import serving_process
from benchmarks.world import client
from mjplug.services.view.pack import build

PAGES, SECONDS, REPEATS = 3, 3.0, 5
FREE = "tcp/127.0.0.1:0"
CHROMIUM = "/usr/bin/chromium"
_TICKS = os.sysconf("SC_CLK_TCK")


def results() -> list[Result]:
    """Measures a robot of 40 bodies with meshes. Pages draw nothing, except for the first picture in Chromium."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder, "meshed_robot.xml")
        model.write_text(meshed_robot(), encoding="utf-8")
        return [_physics(model), *_processor_time(model), *_pack(), _force(model), *_first_picture(model)]


@contextmanager
def relay(endpoint: str) -> Iterator[tuple[str, int]]:
    """Runs `mjplug view` inside the `with` block; yields the page's URL and the process id."""
    command = [sys.executable, "-m", "mjplug", "view", "-e", endpoint, "--port", "0", "--no-open"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    try:
        line = next((text for text in process.stdout if "http://" in text), "")
        match = re.search(r"http://\S+", line)
        assert match, f"no URL in {line!r}"
        yield match[0], process.pid
    finally:
        process.terminate()
        process.wait(10)


def _physics(model: Path) -> Result:
    """Compares steps per second at unlimited speed with and without pages."""
    arguments = ("-m", "mjplug", "serve", str(model), "--set", "sim.speed=max", "--listen", FREE)
    with serving_process(*arguments) as endpoint, relay(endpoint) as (url, _), client(endpoint) as session:

        def watched() -> float:
            with ExitStack() as stack:
                for _ in range(PAGES):
                    stack.enter_context(page(url))
                return _steps_per_second(session)

        return pairs(
            f"steps/s at unlimited speed, 40 bodies with meshes, {PAGES} pages of mjplug view, against none",
            watched,
            lambda: _steps_per_second(session),
            ">= 0.99",
            "{:,.0f}/s",
            REPEATS,
        )


def _steps_per_second(session: zenoh.Session) -> float:
    def step() -> int:
        reply = next(iter(session.get("mjplug/@view/info", timeout=30.0)))
        assert reply.ok is not None
        return int(json.loads(reply.ok.payload.to_bytes())["step"])

    time.sleep(0.5)
    first, began = step(), perf_counter()
    time.sleep(SECONDS)
    return (step() - first) / (perf_counter() - began)


def _processor_time(model: Path) -> list[Result]:
    """Measures the processor time of the worker process and of the relay per frame, and the bytes of a frame."""
    arguments = ("-m", "mjplug", "serve", str(model), "--listen", FREE)
    with serving_process(*arguments) as endpoint, relay(endpoint) as (url, pid), page(url) as shown:
        (server,) = _parents(endpoint)
        workers = _children(server)

        def milliseconds(pids: list[int]) -> float:
            frames, before = shown.frames, sum(map(_seconds, pids))
            time.sleep(SECONDS)
            return 1e3 * (sum(map(_seconds, pids)) - before) / (shown.frames - frames)

        # The model moves, so that frames differ.
        rows = [
            figure(
                f"view, processor time per frame, 40 bodies: {name}",
                lambda p=pids: milliseconds(p),
                "<= 0.8",
                "{:.2f} ms",
                3,
            )
            for name, pids in (("worker process of the server", workers), ("mjplug view, one page", [pid]))
        ]
        rows.append(
            figure("view, bytes per frame, 40 bodies", lambda: float(shown.frame_bytes), "<= 1600", "{:.0f}", 1)
        )
        return rows


def _seconds(pid: int) -> float:
    """Returns the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _children(parent: int) -> list[int]:
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            found += [int(folder.name), *_children(int(folder.name))]
    return found


def _parents(endpoint: str) -> list[int]:
    """Returns the children of this process that listen at an endpoint."""
    command = re.compile(r"mjplug\0serve")
    return [pid for pid in _children(os.getpid()) if command.search(Path(f"/proc/{pid}/cmdline").read_text())][:1]


def _pack() -> list[Result]:
    """Measures how long the drawing pack takes, beside MuJoCo's own file of the compiled model."""
    model = mujoco.MjModel.from_xml_string(meshed_robot())
    size = mujoco.mj_sizeModel(model)
    packed = gzip.compress(build(model), 4)

    def make() -> float:
        began = perf_counter()
        gzip.compress(build(model), 4)
        return perf_counter() - began

    ratio = len(packed) / size
    megabytes = [f"{count / 1e6:.2f} MB" for count in (len(packed), size)]
    return [
        figure("view, time to make the drawing pack, 98,080 vertices", make, "<= 0.5", "{:.2f} s", 3),
        Result(
            "view, size of the drawing pack, against MuJoCo's file (mjb)", *megabytes, ratio, ratio, ratio, "<= 0.5"
        ),
    ]


def _force(model: Path) -> Result:
    """Measures the time from a mouse event in the page to the step at which its force acts."""
    probe = {"probe": {"type": "benchmarks.force_probe:ForceProbe"}}
    server = mjplug.open_server(model, plugins=probe, settings={"sim.speed": 1.0})
    with server, relay(server.endpoint) as (url, _), page(url) as shown:
        body = 1

        def milliseconds() -> float:
            latencies = []
            for _ in range(20):
                began = perf_counter()
                shown.send(op="drag", server=0, body=body, local=[0, 0, 0], target=[0, -1, 0.5])
                assert force_probe.acting.wait(5.0)
                latencies.append(force_probe.newest() - began)
                shown.send(op="drag", server=0, release=True)
                while force_probe.acting.is_set():
                    time.sleep(0.001)
            return 1e3 * statistics.median(latencies)

        return figure("view, from a mouse event to its force at 1 kHz", milliseconds, "<= 5", "{:.1f} ms", 5)


def _first_picture(model: Path) -> list[Result]:
    """Measures the time from the start of `mjplug view` to the first picture in Chromium, which draws in software."""
    if not Path(CHROMIUM).exists():
        return []
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only with Chromium

    arguments = ("-m", "mjplug", "serve", str(model), "--listen", FREE)
    with serving_process(*arguments) as endpoint, sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-dev-shm-usage"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)

        def seconds() -> float:
            began = perf_counter()
            with relay(endpoint) as (url, _):
                tab = browser.new_page(bypass_csp=True)
                tab.goto(url)
                tab.wait_for_function("window.mjplug?.stats().applied > 0", timeout=60_000)
                taken = perf_counter() - began
                tab.close()
            return taken

        rows = [
            figure("view, from `mjplug view` to the first picture, drawn in software", seconds, "<= 5", "{:.1f} s", 3)
        ]
        browser.close()
        return rows
