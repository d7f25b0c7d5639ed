"""A long run at full speed, with everything that uses up memory, file descriptors, threads or shared memory.

The server runs at speed max with a lidar and, where there is OpenGL, a camera. Meanwhile come resets, wrenches (equal,
zero, overlapping), joint and velocity commands, clients that come and go, and kills of worker processes. At the end,
what the server holds must be flat: the last quarter is compared with the first after the warm-up, and a slope fitted.
"""

import argparse
import json
import os
import signal
import sys
import threading
import time

import numpy as np
from cli.client import JSON, Client, wrench, wrenches
from cli.process import Served
from hostile.attack import Tally, add_bounds, random_of
from hostile.observed import children, file_descriptors, resident, shared_memory_of, threads
from hostile.server_kills import LIDAR
from hostile.wire import WORLD, environment_of_world

WARM_UP = 0.25
"""Part of the run after which the first figures count: caches and arenas of the allocator grow until then."""

MAX_RSS = 24 << 20
"""How far RSS may grow from the first to the last quarter after the warm-up [bytes]; an arena of glibc has 64 MiB."""

MAX_SLOPE = 0.5 * (1 << 20)
"""How fast RSS may grow in the long run [bytes per minute]; counts from 10 minutes on."""

MAX_FURTHER = 4
"""Largest increase of file descriptors, threads or shared memory files."""

STARTED = 120.0
"""How long the worker processes may take on a busy machine until they publish [s]."""

CAMERA = ("--set", "plugins.camera={type: camera, front: {publish_rate: 10.0}}")


class Load(threading.Thread):
    """Calls and commands in the rhythm of a busy client, and others that come and go."""

    def __init__(self, server, tally, workers_to_kill, seed):
        super().__init__(daemon=True)
        self._server, self._tally, self._kills = server, tally, workers_to_kill
        self._random = random_of(seed, 0)
        self.ended = threading.Event()
        self.failure = None

    def run(self):
        try:
            with Client(self._server.endpoint) as client:
                for key in ("clock", "**/@json", "joint_states"):
                    client.session.declare_subscriber(key, lambda _: None)
                while not self.ended.is_set():
                    self._round(client)
        except BaseException as error:
            self.failure = error

    def _round(self, client):
        random, tally = self._random, self._tally
        force = (random.uniform(-1, 1), 0.0, 0.0)
        duration = random.choice((0.0, 0.002, 0.01, 0.5))
        pushes = [wrench(random.choice(("link_a", "link_b")), force=force, seconds=duration)] * random.choice(
            (1, 2, 20)
        )
        pushes += [wrench("link_a", seconds=0.0), wrench("link_b", force=force, seconds=0.3)]
        pending = [
            client.send("external_wrench/apply_wrench", json.dumps(wrenches(*pushes)), JSON, timeout=60.0)
            for _ in range(random.choice((1, 3)))
        ]
        command = {"name": ["shoulder", "elbow"], "position": [random.uniform(-1, 1), random.uniform(-2, 2)]}
        client.put("arm/joint_commands", json.dumps(command), JSON)
        client.put("cmd_vel", json.dumps({"linear": {"x": random.uniform(-0.1, 0.1)}}), JSON)
        client.put("cmd_vel", random.randbytes(40))
        client.send("mjplug/get_diagnostics").answer(60.0)
        if random.random() < 0.3:
            client.do("mjplug/reset_world")
        for one in pending:
            answer = one.answer(60.0)
            tally.inputs += 1
            if not answer.ok:
                raise AssertionError(f"a push is answered {answer}")
            tally.count("refused", not answer.json["success"])
        if random.random() < 0.2:
            with Client(self._server.endpoint) as passing:
                passing.listen("**")
                passing.put("cmd_vel", bytes(5000))
                passing.send("mjplug/interfaces").answer(60.0)
            tally.count("clients")
        if self._kills and random.random() < 0.02:
            self._kill_worker()
        self.ended.wait(0.02)

    def _kill_worker(self):
        for pid in sorted(self._server.workers)[:1]:
            os.kill(pid, signal.SIGKILL)
            self._tally.count("worker kills")


def figures(pid):
    """Returns what the server and its workers hold now."""
    family = [pid, *children(pid)]
    return {
        "RSS": resident(pid),
        "fds": file_descriptors(pid),
        "threads": threads(pid),
        "shm": len(shared_memory_of(family)),
    }


def soak(tally, seconds, kills, camera):
    """Runs the load and samples; returns the samples with their times."""
    options = ["--speed", "max", "--set", "sim.paused=false", "--plugin", "lidar", *LIDAR, *(CAMERA if camera else ())]
    server = Served(str(WORLD), *options, cwd=WORLD.parent, env=environment_of_world())
    samples = []
    try:
        # A worker that starts later would count as growth.
        with Client(server.endpoint) as client:
            for heard in [client.listen(key) for key in ("scan", *(("camera/front/color",) if camera else ()))]:
                heard.sample(STARTED)
        load = Load(server, tally, kills, tally.seed)
        load.start()
        began, interval, next_row = time.monotonic(), max(0.1, seconds / 400), 0.0
        print(f"{'min':>5} {'RSS MiB':>8} {'fds':>5} {'threads':>7} {'shm':>4} {'calls':>7}", flush=True)
        while (now := time.monotonic() - began) < seconds and load.failure is None and server.running:
            now_held = figures(server.process.pid)
            samples.append((now, now_held))
            if now >= next_row:
                print(
                    f"{now / 60:5.1f} {now_held['RSS'] / 2**20:8.1f} {now_held['fds']:5} {now_held['threads']:7} "
                    f"{now_held['shm']:4} {tally.inputs:7}",
                    flush=True,
                )
                next_row += 60.0
            time.sleep(interval)
        load.ended.set()
        load.join(90.0)
        if load.is_alive() or load.failure is not None:
            tally.count("unanswered")
            tally.find("all", f"the load failed: {load.failure!r}")
        if not server.running:
            tally.find("all", f"the server ended with {server.process.returncode}: {server.err.text[-2000:]}")
            return samples
        with Client(server.endpoint) as client:
            client.do("mjplug/set_pause", paused=True)
            client.do("mjplug/reset_world")
            state = json.loads(client.do("probe/state"))
            if state["qpos"][7:14] != [2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]:
                tally.find("all", f"link_a is at {state['qpos'][7:14]} after a reset")
        code = server.stop(within=30.0)
        if code != 0 or "Traceback" in server.err.text:
            tally.find("all", f"the server ended with {code}: {server.err.text[-2000:]}")
    finally:
        server.kill()
    return samples


def judge(tally, samples, seconds):
    """Compares the last quarter of the samples with the first after the warm-up."""
    steady = [(now, held) for now, held in samples if now >= WARM_UP * seconds]
    if len(steady) < 8:
        tally.find("all", f"only {len(samples)} samples: the machine is too busy, or the run too short")
        return
    quarter = len(steady) // 4
    for name in ("RSS", "fds", "threads", "shm"):
        values = np.array([held[name] for _, held in steady], float)
        first, last = float(np.median(values[:quarter])), float(np.median(values[-quarter:]))
        bound = MAX_RSS if name == "RSS" else MAX_FURTHER
        tally.counts[f"{name} grown"] = f"{(last - first) / 2**20:.1f} MiB" if name == "RSS" else int(last - first)
        if last - first > bound:
            tally.find("all", f"{name} grows from {first:.0f} to {last:.0f}, by more than {bound}")
    if seconds >= 600:
        minutes = np.array([now / 60 for now, _ in steady])
        slope = float(np.polyfit(minutes, [held["RSS"] for _, held in steady], 1)[0])
        tally.counts["KiB a minute"] = round(slope / 1024)
        if slope > MAX_SLOPE:
            tally.find("all", f"RSS grows by {slope / 1024:.0f} KiB a minute")


def main(argv=None):
    """Runs the soak; returns the exit code."""
    parser = argparse.ArgumentParser(
        description="Serves under load for a long time; what the server holds must be flat."
    )
    add_bounds(parser, 0, 1800.0)
    parser.add_argument("--no-camera", action="store_true", help="without a camera, which needs OpenGL")
    parser.add_argument("--no-kills", action="store_true", help="without kills of worker processes")
    options = parser.parse_args(argv)
    tally = Tally("soak", options.seed, options.seconds, counts={"refused": 0, "unanswered": 0})
    samples = soak(tally, options.seconds, not options.no_kills, not options.no_camera)
    if samples:
        judge(tally, samples, options.seconds)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
