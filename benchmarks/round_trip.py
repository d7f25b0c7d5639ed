"""Round trip times of a service request and of a goal of an action, compared with a plain Zenoh query.

Both servers are separate processes.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter

import zenoh

from benchmarks.measure import Result, pairs
from benchmarks.world import SMALL, client
from mjplug.wire.endpoints import with_free_port
from mjplug_schemas.control_msgs_action import GripperCommand
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause

QUERIES = 300

BARE = """
import sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("scouting/multicast/enabled", "false")
endpoint = sys.argv[1]
config.insert_json5("listen/endpoints", f'["{endpoint}"]')
with zenoh.open(config) as session:
    answer = bytes.fromhex(sys.argv[2])
    session.declare_queryable("bare", lambda query: query.reply("bare", answer))
    print("ready", endpoint, flush=True)
    sys.stdin.read()
"""


@contextmanager
def serving_process(*command: str) -> Iterator[str]:
    """Runs a server inside the `with` block and yields its endpoint."""
    process = subprocess.Popen(
        [sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    try:
        line = next((text for text in process.stdout if "ready" in text), "")
        match = re.search(r"tcp/\S+:\d+", line)
        assert match, f"no endpoint in {line!r}"
        yield match[0]
    finally:
        process.terminate()
        process.wait(10)


def round_trip(session: zenoh.Session, key: str, payload: bytes) -> float:
    """Returns the median time of a query [µs]."""
    times = []
    for _ in range(QUERIES):
        began = perf_counter()
        replies = list(session.get(key, payload=payload, encoding=zenoh.Encoding.APPLICATION_CDR))
        times.append(perf_counter() - began)
        assert replies[0].ok is not None
    return median(times) * 1e6


def results() -> list[Result]:
    """Measures `set_pause` and a goal on a server that runs in real time."""
    request = SetPause.Request(paused=False).to_cdr()
    answer = SetPause.Response(success=True, message="the simulation is already running").to_cdr()
    free = "tcp/127.0.0.1:0"
    bare_arguments = ("-c", BARE, with_free_port(free), answer.hex())
    plugin = ("--plugin", "benchmarks.ended_goal:EndedGoal")
    served_arguments = ("-m", "mjplug", "serve", SMALL, *plugin, "--listen", free)
    goal = GripperCommand.Goal().to_cdr()
    with (
        serving_process(*bare_arguments) as bare_at,
        serving_process(*served_arguments) as served_at,
        client(bare_at) as bare,
        client(served_at) as session,
    ):
        return [
            pairs(
                "round trip of set_pause while running in real time, against a bare Zenoh query",
                lambda: round_trip(session, "mjplug/set_pause", request),
                lambda: round_trip(bare, "bare", request),
                "<= 2",
                "{:.0f} µs",
            ),
            pairs(
                "round trip of a goal that ends at once, in one query, against a bare Zenoh query",
                lambda: round_trip(session, "ended_goal", goal),
                lambda: round_trip(bare, "bare", request),
                "<= 3",
                "{:.0f} µs",
            ),
        ]
