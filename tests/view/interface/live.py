"""A server and `mjplug view`, each a process, and pages in Chromium."""

import json
import os
import signal
import subprocess
from pathlib import Path

import warm_python
from cli.process import COMMAND, STARTING, Lines, Served, environment
from waits import TIMEOUT

from mjplug.client import connect

STATES = ("--plugin", "free_joint_state_publisher:states")


class View:
    """A running `mjplug view`."""

    def __init__(self, endpoint, *arguments, cwd):
        self.process = warm_python.popen(
            COMMAND, ("view", "--connect", endpoint, "--port", "0", "--no-open", *arguments),
            cwd=cwd, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)
        ready = self.out.wait_for(r"(http://\S+)", STARTING)
        assert ready is not None, self.err.wait_for_end()
        self.url = ready[1]

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


class Simulation:
    """What a server says about itself, without the page."""

    def __init__(self, endpoint):
        self.endpoint = endpoint
        self._client = connect(endpoint)
        self._states = None

    def close(self):
        self._client.close()

    def call(self, service, **fields):
        return self._client.call(service, **fields)

    def parameter(self, name):
        value = self.call("~/get_parameters", names=[name]).values[0]
        return {1: value.bool_value, 3: value.double_value, 4: value.string_value}[value.type]

    @property
    def paused(self):
        return self.parameter("sim.paused")

    def count(self, name):
        """Returns a counter of the diagnostics, at most a second old."""
        statuses = json.loads(self.call("~/get_diagnostics").message)["status"]
        (simulation,) = (status for status in statuses if status["name"].endswith(": simulation"))
        (value,) = (entry["value"] for entry in simulation["values"] if entry["key"] == name)
        return int(value)

    def box(self):
        """Returns position [m] and velocity [m/s] of the box, each with 3 numbers."""
        if self._states is None:
            self._client.wait_for("/states/free_joint_states")
            self._states = self._client.subscribe("/states/free_joint_states", depth=1)
        (state,) = self._states.next(timeout=TIMEOUT).free_joints
        return vector(state.pose.pose.position), vector(state.twist.twist.linear)


def vector(message):
    return message.x, message.y, message.z


def kill_by_argument(text):
    """Kills the processes that have a text in their command line; returns their number."""
    killed = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if text in (folder / "cmdline").read_bytes().decode(errors="replace"):
                os.kill(int(folder.name), signal.SIGKILL)
                killed += 1
        except OSError:
            continue
    return killed


__all__ = ["STATES", "Served", "Simulation", "View", "kill_by_argument"]
