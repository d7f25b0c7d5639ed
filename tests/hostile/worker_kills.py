"""Kills and stops worker processes of a server under load, and looks at what that does to everybody else.

    python -m hostile.worker_kills --count 100 --seed 1 --seconds 3600        (in tests/)

Cameras are triggered all the time, one instance runs in lockstep, and /clock and `set_pause` go on. A worker is killed
(SIGKILL) or stopped (SIGSTOP); then another one must take its place. It is a finding if the server crashes or logs a
traceback, a trigger or a `set_pause` has no answer, or a process, a file descriptor, a thread or memory is left behind.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from cli.client import Client
from cli.process import Served

SCENE = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <light pos="0 0 3"/><geom type="plane" size="5 5 .1"/>
    <body pos="0 0 1"><joint type="hinge" axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/></body>
    <camera name="eye" pos="0 0 2" resolution="64 48"/>
  </worldbody>
</mujoco>
"""

POLLED = ("one", "two")
"""Instances with a polled camera."""

CONFIG = f"""
model: scene.xml
plugins:
{"".join(f"  {name}: {{type: camera, eye: {{policy: polled}}, trigger_timeout: 20}}" + chr(10) for name in POLLED)}
  locked: {{type: camera, sync: true, camera_publish_rate: 5}}
"""

PROVEN = 10.5
"""A worker that was killed younger than this is started again after ever longer pauses [s]."""

REPLACED = 120.0
"""How long it may take until another worker is there [s]: silence of 10 s, a pause, and a start on a busy machine."""

ANSWERED = 60.0
"""How long a trigger may take [s]: its own timeout of 20 s, on a busy machine."""

PAUSED = 10.0
"""How long `set_pause` may take [s]; without load it is a millisecond."""


class Attack:
    """One run.

    Attributes:
        findings: One text for each.
        counts: How often each signal was sent, and how the triggers ended.
        slowest: The longest answer of `set_pause` [s].
    """

    def __init__(self, seed, folder):
        self.findings = []
        self.counts = {"SIGKILL": 0, "SIGSTOP": 0, "published": 0, "refused": 0}
        self.slowest = 0.0
        self.random = random.Random(seed)
        self.ended = threading.Event()
        self.seen = {}
        (folder / "scene.xml").write_text(SCENE)
        (folder / "config.yaml").write_text(CONFIG)
        self.server = Served("config.yaml", cwd=folder)

    @property
    def workers(self):
        """The ids of the worker processes."""
        found = self.server.workers
        for pid in found:
            self.seen.setdefault(pid, time.monotonic())
        return found

    def find(self, what):
        self.findings.append(what)
        print(f"FINDING {what}", flush=True)

    def held(self):
        """What the server holds that must not grow: file descriptors, threads, memory shared with workers."""
        proc = Path(f"/proc/{self.server.process.pid}")
        maps = (proc / "maps").read_text()
        return {
            "file descriptors": len(os.listdir(proc / "fd")),
            "threads": len(os.listdir(proc / "task")),
            "shared states": maps.count("mjplug-states"),
            "files in /dev/shm": maps.count("/dev/shm/"),
        }

    def image(self, client, name):
        """Asks for one image; returns whether it was published."""
        return client.request(f"{name}/eye/trigger").answer(ANSWERED).json["success"]

    def trigger(self, client, name):
        """Asks for images until the end; each request must be answered."""
        while not self.ended.is_set():
            try:
                self.counts["published" if self.image(client, name) else "refused"] += 1
            except AssertionError as error:
                self.find(f"a trigger of {name}: {error}")
            self.ended.wait(0.02)

    def pause(self, client):
        """Pauses and resumes until the end; each request must be answered soon."""
        paused = False
        while not self.ended.is_set():
            paused, began = not paused, time.monotonic()
            try:
                client.request("mjplug/set_pause", paused=paused).answer(PAUSED)
            except AssertionError as error:
                self.find(f"set_pause: {error}")
            self.slowest = max(self.slowest, time.monotonic() - began)
            self.ended.wait(0.1)
        client.request("mjplug/set_pause", paused=False).answer(ANSWERED)

    def wait_for(self, condition, what, within=REPLACED):
        until = time.monotonic() + within
        while not condition():
            if time.monotonic() > until:
                self.find(f"{what} within {within:g} s")
                return False
            time.sleep(0.05)
        return True

    def run(self, count, seconds, hang):
        """Kills workers; `hang` is the part of them that is stopped instead."""
        instances, until = len(POLLED) + 1, time.monotonic() + seconds
        self.wait_for(lambda: len(self.workers) == instances, f"{instances} workers did not start")
        with Client(self.server.endpoint) as client:
            images = client.listen("locked/eye/color")
            for name in POLLED:
                client.listen(f"{name}/eye/color")
            for name in POLLED:
                # The first ones may come while the process is still starting.
                self.wait_for(lambda name=name: self.image(client, name), f"no image of {name}")
            images.sample(REPLACED)
            before = self.held()
            threads = [threading.Thread(target=self.trigger, args=(client, name)) for name in POLLED]
            threads.append(threading.Thread(target=self.pause, args=(client,)))
            for thread in threads:
                thread.start()
            for index in range(count):
                if time.monotonic() > until or self.findings:
                    break
                self.kill(index, count, hang, instances)
            self.ended.set()
            for thread in threads:
                thread.join()
            images.forget()
            try:
                images.sample(REPLACED)
            except AssertionError as error:
                self.find(f"lockstep does not go on: {error}")
            self.wait_for(
                lambda: all(now <= before[what] + 2 for what, now in self.held().items()),
                f"the server does not come back to {before}",
                within=30.0,
            )
            print(f"held before {before}, after {self.held()}", flush=True)

    def kill(self, index, count, hang, instances):
        number = signal.SIGSTOP if self.random.random() < hang else signal.SIGKILL
        if count > instances:
            self.wait_for(
                lambda: any(time.monotonic() - self.seen[pid] > PROVEN for pid in self.workers), "no worker grows old"
            )
            old = [pid for pid in self.workers if time.monotonic() - self.seen[pid] > PROVEN]
        else:
            old = list(self.workers)
        time.sleep(0.3 * self.random.random())
        victim = self.random.choice(sorted(old))
        try:
            os.kill(victim, number)
        except ProcessLookupError:
            self.find(f"kill {index}: worker {victim} had ended by itself")
            return
        self.counts[signal.Signals(number).name] += 1
        # The next process is killed meanwhile, unless all have ended.
        self.wait_for(lambda: victim not in self.workers, f"kill {index}: worker {victim} was not ended")
        if index == count - 1:
            self.wait_for(lambda: len(self.workers) == instances, f"kill {index}: worker {victim} was not replaced")

    def end(self):
        """Stops the server, and checks that nothing of it is left."""
        workers = self.workers
        if not self.server.running:
            self.find(f"the server ended with {self.server.process.returncode}")
        else:
            code = self.server.stop(within=30.0)
            if code != 0:
                self.find(f"the server ended with {code}")
        left = [pid for pid in workers | set(self.seen) if _is_worker(pid)]
        if left:
            self.find(f"worker processes are left: {left}")
        if "Traceback" in self.server.err.text:
            self.find("the log has a traceback:\n" + self.server.err.text)


def _is_worker(pid):
    try:
        return b"mjplug.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


def attack(count, seed, seconds, hang, busy):
    """Runs the attack; returns it with its findings."""
    programs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            run = Attack(seed, Path(folder))
            try:
                run.run(count, seconds, hang)
            finally:
                run.ended.set()
                run.end()
            return run
    finally:
        for program in programs:
            program.kill()
            program.wait()


def main(argv=None):
    """Attacks as the arguments say; returns 1 if there is a finding."""
    parser = argparse.ArgumentParser(description="Kills worker processes of a server under load.")
    parser.add_argument("--count", type=int, default=20, help="number of kills (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random choices (default 0)")
    parser.add_argument("--seconds", type=float, default=600.0, help="limit of wall time [s] (default 600)")
    parser.add_argument("--hang", type=float, default=0.2, help="part that is stopped, not killed (default 0.2)")
    parser.add_argument("--busy", type=int, default=2, help="busy programs beside the server (default 2)")
    given = parser.parse_args(argv)
    began = time.monotonic()
    run = attack(given.count, given.seed, given.seconds, given.hang, given.busy)
    counts = ", ".join(f"{number} {what}" for what, number in run.counts.items())
    print(
        f"worker kills: {counts}, slowest set_pause {run.slowest:.3f} s, {len(run.findings)} findings "
        f"in {time.monotonic() - began:.0f} s",
        flush=True,
    )
    return 1 if run.findings else 0


if __name__ == "__main__":
    sys.exit(main())
