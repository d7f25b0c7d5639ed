"""Each command in a program that is started as a user starts it.

Most other tests run commands in a process that has already imported what they need. A missing import, and whatever else
only a real start shows, does not fail there.
"""

import os
import signal
import subprocess
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import typer
from cli.process import FREE_PORT, Lines, environment

from mjplug.cli.app import app

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

MJPLUG = Path(sysconfig.get_path("scripts"), "mjplug")
STARTING = 120.0
"""How long a program may take on a machine with other work [s]."""

WITH_SERVER = (
    "top -n 1",
    "doctor",
    "doctor --quick",
    "topic list -t",
    "topic info /clock",
    "topic type /clock",
    "topic find rosgraph_msgs/msg/Clock",
    "topic echo /clock --once",
    "topic pub /base_velocity/cmd_vel geometry_msgs/msg/Twist {} --once",
    "topic hz /clock --window 2 --count 1",
    "topic bw /clock --count 1",
    "topic delay /joint_states --count 1",
    "service list",
    "service type /mjplug/set_pause",
    "service info /mjplug/set_pause",
    "service find std_srvs/srv/Trigger",
    "service call /mjplug/get_diagnostics",
    "node list",
    "node info /mjplug",
    "param list /mjplug",
    "param get /mjplug sim.speed",
    "param set /mjplug sim.speed 1.0",
    "param describe /mjplug sim.speed",
    "param dump /mjplug",
    "param load /mjplug parameters.yaml",
    "sim state",
    "sim speed 1",
    "sim pause",
    "sim step 2",
    "sim reset",
    "sim resume",
)
WITHOUT_SERVER = (
    "completion bash",
    "interface list",
    "interface show std_msgs/msg/String",
    "interface proto std_msgs/msg/String",
    "interface hash std_msgs/msg/String",
    "model info bundled:arm",
    "plugin list",
    "plugin info heartbeat",
    "plugin new street_lamp",
    "config check robot.yaml",
    "config show robot.yaml",
    "config schema",
    "config init bundled:arm",
    "config convert ros.yaml --model bundled:box",
    "keys init --host localhost",
    "keys add alice --role viewer",
    "keys renew alice",
    "keys revoke alice",
    "keys show",
)
UNTIL_A_SIGNAL = ("serve bundled:box", "router")


def commands(group, path=()):
    """Yields the words of each command that the program has."""
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))
    if not hasattr(group, "commands"):
        yield " ".join(path)


def run(line, folder, endpoint="tcp/127.0.0.1:1"):
    done = subprocess.run(
        [MJPLUG, *line.split()], cwd=folder, env=environment({"MJPLUG_CONNECT": endpoint}),
        capture_output=True, text=True, check=False, timeout=STARTING,
    )  # fmt: skip
    return f"mjplug {line}: {done.returncode}\n{done.stdout}{done.stderr}" if done.returncode else ""


@pytest.fixture
def start(tmp_path):
    """Starts a program that runs until a signal; returns it and its endpoint."""
    started = []

    def start(line):
        program = subprocess.Popen(
            [MJPLUG, *line.split(), *FREE_PORT], cwd=tmp_path, env=environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        started.append((program, Lines(program.stderr)))
        ready = Lines(program.stdout).wait_for(r"(tcp/\S+:\d+)", STARTING)
        assert ready is not None, started[-1][1].text
        return program, ready[1]

    yield start
    for program, _ in started:
        program.kill()
        program.wait()


def test_each_command_of_the_program_is_among_those_that_are_run():
    lines = [*WITH_SERVER, *WITHOUT_SERVER, *UNTIL_A_SIGNAL]
    known = set(commands(typer.main.get_command(app)))
    assert known == {next(name for name in known if f"{line} ".startswith(f"{name} ")) for line in lines}


def test_each_command_that_asks_a_server_works_in_a_new_process(start, tmp_path):
    program, endpoint = start(
        "serve bundled:box --plugin heartbeat --plugin joint_state_publisher --plugin base_velocity "
        "--set plugins.base_velocity.body=box"
    )
    (tmp_path / "parameters.yaml").write_text("/mjplug: {ros__parameters: {sim: {speed: 1.0}}}\n")
    # One after the other, because some of them pause the simulation.
    failures = [failure for line in WITH_SERVER if (failure := run(line, tmp_path, endpoint))]
    assert failures == []
    program.send_signal(signal.SIGTERM)
    assert program.wait(STARTING) == 0


def test_each_command_without_a_server_works_in_a_new_process(tmp_path):
    (tmp_path / "robot.yaml").write_text("model: bundled:box\nplugins: {beat: {type: heartbeat}}\n")
    (tmp_path / "ros.yaml").write_text(
        "/**:\n  ros__parameters:\n    mujoco_plugins:\n      beat:\n"
        "        type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin\n"
    )
    keys = [line for line in WITHOUT_SERVER if line.startswith("keys ")]
    others = [line for line in WITHOUT_SERVER if line not in keys]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        failures = [failure for failure in pool.map(lambda line: run(line, tmp_path), others) if failure]
    # Each of these needs the folder that the first one makes.
    failures += [failure for line in keys if (failure := run(line, tmp_path))]
    assert failures == []


def test_a_router_runs_until_sigterm_in_a_new_process(start):
    program, _ = start("router")
    program.send_signal(signal.SIGTERM)
    assert program.wait(STARTING) == 0
