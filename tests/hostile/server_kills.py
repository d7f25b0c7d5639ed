"""Kills the server with SIGKILL while clients call it: they get errors and do not hang, and the next server takes over.

Each round starts a server on the same port, lets clients call and listen, kills it, and looks for what is left.
"""

import json
import sys
import threading
import time

from cli.client import Client, wrench, wrenches
from cli.process import Served
from hostile.attack import Tally, arguments, random_of
from hostile.observed import SHARED_MEMORY, children, is_running, shared_memory_of
from hostile.wire import WORLD, environment_of_world

from mjplug.client import ClientError, connect

CALLERS = 3
TIMEOUT = 10.0
"""What each call of a client may take [s]."""

MAX_WAIT = 60.0
"""After this, a client that has not ended its call counts as hanging [s]."""


class Caller(threading.Thread):
    """Calls without pause until a call fails; notes how."""

    def __init__(self, endpoint, random):
        super().__init__(daemon=True)
        self._endpoint, self._random = endpoint, random
        self.calls, self.error, self.wrong = 0, None, None
        self.started_calls = threading.Event()

    def run(self):
        waiting = wrenches(wrench("link_a", seconds=1000.0))
        try:
            with connect(self._endpoint, timeout=30.0) as client:
                while self.error is None:
                    try:
                        client.call("~/step_simulation", steps=1, timeout=TIMEOUT)
                        self.calls += 1
                        self.started_calls.set()
                        if self._random.random() < 0.1:
                            # A call that waits for ever, as the simulation is paused.
                            client.call("/external_wrench/apply_wrench", timeout=TIMEOUT, **waiting)
                    except ClientError as error:
                        self.error = error
        except ClientError as error:
            self.error = error
        except BaseException as error:
            self.wrong = error
        finally:
            self.started_calls.set()


def round_of(tally, index, port, options):
    """Starts, loads and kills one server; returns its port."""
    random = random_of(tally.seed, index)
    before = set(SHARED_MEMORY.iterdir())
    began = time.monotonic()
    server = Served(
        str(WORLD), *options, cwd=WORLD.parent, env=environment_of_world(), listen=("--listen", f"tcp/127.0.0.1:{port}")
    )
    tally.counts["slowest start [s]"] = max(
        tally.counts.get("slowest start [s]", 0.0), round(time.monotonic() - began, 1)
    )
    try:
        port = int(server.endpoint.rpartition(":")[2])
        with Client(server.endpoint) as client:
            listened = client.listen("clock/@json")
            client.send("external_wrench/apply_wrench", json.dumps(wrenches(wrench("link_a", seconds=100.0))))
            callers = [Caller(server.endpoint, random_of(tally.seed, index * 100 + i)) for i in range(CALLERS)]
            for caller in callers:
                caller.start()
            for caller in callers:
                caller.started_calls.wait(MAX_WAIT)
            time.sleep(random.uniform(0.0, 0.3))
            listened.sample()
            family = children(server.process.pid)
            mapped = shared_memory_of([server.process.pid, *family])
            server.kill()
            for caller in callers:
                caller.join(MAX_WAIT)
    finally:
        server.kill()
    tally.inputs += 1
    for caller in callers:
        tally.count("calls", caller.calls)
        if caller.is_alive():
            tally.count("unanswered")
            tally.find(index, f"a call still waits {MAX_WAIT} s after the server was killed")
        elif caller.wrong is not None:
            tally.find(index, f"a client fails with {caller.wrong!r}, which is no ClientError")
        elif caller.calls == 0:
            tally.find(index, f"a client never got an answer: {caller.error}")
    _leftovers(tally, index, family, mapped, before)
    if "Traceback" in server.err.text:
        tally.find(index, server.err.text[-3000:])
    return port


def _leftovers(tally, index, family, mapped, before):
    """Looks for worker processes and shared memory of the server that was killed."""
    deadline = time.monotonic() + 30.0
    while (left := [pid for pid in family if is_running(pid)]) and time.monotonic() < deadline:
        time.sleep(0.1)
    if left:
        tally.find(index, f"processes {left} of the killed server still run after 30 s")
    # Only what this server had mapped: other programs use /dev/shm too.
    names = {path.split(" (deleted)")[0] for path in mapped}
    kept = [str(path) for path in SHARED_MEMORY.iterdir() if str(path) in names and path not in before]
    if kept:
        tally.find(index, f"shared memory of the killed server is left: {kept}")


def main(argv=None):
    """Runs the attack; returns the exit code."""
    options = arguments(argv, "Kills servers while clients call them.", 10, 900.0)
    tally = Tally("server kills", options.seed, options.seconds, counts={"unanswered": 0})
    port = 0
    for index in range(options.first, options.first + options.count):
        # Every other one with a worker process.
        port = round_of(tally, index, port, ("--plugin", "lidar", *LIDAR) if index % 2 else ())
        if tally.over:
            break
    return tally.end()


LIDAR = (
    "--set",
    "plugins.lidar.scan={site: lidar, resolution: [36, 1], azimuth_range: [-3, 3], elevation_range: [0],"
    " max_range: 10, update_rate: 20}",
)
"""A lidar for the world, which makes the server start a worker process."""


if __name__ == "__main__":
    sys.exit(main())
