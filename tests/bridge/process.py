"""Runs the bridge in a separate Python interpreter."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from cli.process import Lines, environment
from waits import TIMEOUT

HERE = Path(__file__).parent
SOURCE = HERE.parents[1] / "bridge_ros2"
STAND_IN = HERE / "stand_in"

PYTHON = os.environ.get("MJPLUG_ROS_PYTHON", sys.executable)
"""The Python of ROS, with rclpy and zenoh; another one with zenoh gets the stand-in."""

REAL = subprocess.run([PYTHON, "-c", "import rclpy"], capture_output=True, check=False).returncode == 0
"""Whether a real rclpy is installed, not only the stand-in."""

# The tests themselves need no more than its message packages.
sys.path[:0] = [str(STAND_IN), str(SOURCE)]


class Bridge:
    """A running bridge.

    Args:
        folder: Where to keep its parameters.
        parameters: Those that are not to have their defaults.
        env: More environment.
        command: What to run.
    """

    def __init__(self, folder, parameters, env, command=(PYTHON, str(HERE / "run_bridge.py"))):
        file = folder / f"bridge{len(list(folder.iterdir()))}.yaml"
        file.write_text(json.dumps({"/mjplug_bridge": {"ros__parameters": parameters}}), encoding="utf-8")
        self.process = subprocess.Popen(
            [*command, "--ros-args", "--params-file", str(file)],
            env=environment(env),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.log = Lines(self.process.stdout)

    def wait_for(self, pattern, within=TIMEOUT):
        """Waits for a line of its log."""
        found = self.log.wait_for(pattern, within)
        assert found is not None, f"ended without a line with {pattern!r}:\n{self.log.text}"
        return found

    def end(self, within=TIMEOUT):
        """Waits until it ends by itself; returns the exit code."""
        code = self.process.wait(within)
        self.log.wait_for_end()
        return code

    def stop(self, number=signal.SIGINT):
        """Sends a signal and returns the exit code."""
        self.process.send_signal(number)
        return self.end(TIMEOUT)

    def finish(self):
        """Ends it by SIGTERM, or by force if that does not help.

        A participant of DDS that is killed stays in the graph until its lease has run out, and the next test would
        call its services.
        """
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(TIMEOUT)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
