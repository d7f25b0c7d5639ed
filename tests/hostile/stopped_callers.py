"""Stops clients with SIGSTOP while they listen and call: other clients must be served as before.

A stopped client keeps its connection and reads nothing. Each round stops some clients, lets others call meanwhile, and
either continues or kills the stopped ones.
"""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time

from cli.client import Client
from cli.process import Served, environment
from hostile.attack import Tally, arguments, random_of
from hostile.observed import file_descriptors, threads
from hostile.wire import WORLD, environment_of_world

CALLS = 40
"""Calls of the client that is not stopped, in each round."""

TIMEOUT = 30.0
"""What each of them may take on a busy machine [s]; without a cure they would get no answer at all."""

STOPPED = """
    import json, sys, threading, zenoh
    from zenoh.handlers import Callback
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    session = zenoh.open(config)
    samples = []
    if sys.argv[2] != "caller":
        session.declare_subscriber(sys.argv[3], Callback(samples.append, indirect=False))
    end = threading.Event()
    # Calls that wait until the world is reset, so that answers go to clients that do not read.
    push = {"wrenches": {"external_wrenches": [
        {"wrench": {"header": {"frame_id": "link_a"}}, "duration": {"sec": 1000}}]}}
    if sys.argv[2] != "listener":
        for _ in range(30):
            answered = Callback(print, indirect=False)
            session.get("external_wrench/apply_wrench", answered, payload=json.dumps(push), timeout=900.0)
    for _ in session.get("mjplug/get_parameters", timeout=60.0):
        print("ready", flush=True)
    end.wait()
"""

LISTENED = ("**", "clock", "**/@json", "joint_states", "tf")


def start_client(endpoint, kind, key):
    """Starts a client in a separate process and waits until it is connected."""
    command = [sys.executable, "-c", textwrap.dedent(STOPPED), endpoint, kind, key]
    client = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
    while "ready" not in client.stdout.readline():
        if client.poll() is not None:
            raise AssertionError("a client ended before it was ready")
    return client


def round_of(tally, index, server, client):
    """Stops some clients while another one calls."""
    random = random_of(tally.seed, index)
    stopped = [
        start_client(server.endpoint, random.choice(("listener", "caller", "both")), random.choice(LISTENED))
        for _ in range(random.choice((1, 2, 3)))
    ]
    try:
        for one in stopped:
            os.kill(one.pid, signal.SIGSTOP)
        client.do("mjplug/set_pause", paused=False)
        heard = client.listen("clock/@json")
        slowest = 0.0
        for call in range(CALLS):
            began = time.monotonic()
            answer = client.send("mjplug/get_parameters", b'{"names": ["sim.speed"]}', timeout=TIMEOUT).answer(
                TIMEOUT + 5
            )
            slowest = max(slowest, time.monotonic() - began)
            tally.inputs += 1
            if not answer.ok or len(answer.json["values"]) != 1:
                tally.count("unanswered", answer.payload == b"Timeout")
                tally.find(index, f"call {call} beside {len(stopped)} stopped clients: {answer}")
                return
            time.sleep(0.02)
        heard.forget()
        before = heard.next()
        heard.until(lambda message: message != before)
        # Answers to the stopped callers leave now.
        client.do("mjplug/reset_world")
        state = json.loads(client.do("probe/state"))
        if state["qpos"][7:10] != [2.0, 0.0, 1.0]:
            tally.find(index, f"link_a is at {state['qpos'][7:10]} after a reset")
        tally.counts["slowest call [s]"] = max(tally.counts.get("slowest call [s]", 0.0), round(slowest, 2))
    except AssertionError as error:
        tally.count("unanswered")
        tally.find(index, str(error))
    finally:
        continued = random.random() < 0.5
        for one in stopped:
            if continued:
                os.kill(one.pid, signal.SIGCONT)
            one.kill()
            one.communicate()


def main(argv=None):
    """Runs the attack; returns the exit code."""
    options = arguments(argv, "Stops clients while others call.", 20, 900.0)
    tally = Tally("stopped clients", options.seed, options.seconds, counts={"unanswered": 0})
    server = Served(str(WORLD), "--set", "sim.paused=false", cwd=WORLD.parent, env=environment_of_world())
    try:
        with Client(server.endpoint) as client:
            client.do("probe/state")
            pid = server.process.pid
            before = file_descriptors(pid), threads(pid)
            for index in range(options.first, options.first + options.count):
                round_of(tally, index, server, client)
                if tally.over:
                    break
            # Links of clients that were killed while stopped end when their lease does, after 10 s.
            deadline = time.monotonic() + 60.0
            while time.monotonic() < deadline:
                after = file_descriptors(pid), threads(pid)
                if after[0] <= before[0] + 8 and after[1] <= before[1] + 8:
                    break
                time.sleep(0.2)
            else:
                tally.find(
                    "all", f"file descriptors and threads: {before} before, {after} a minute after the last round"
                )
        code = server.stop(within=30.0)
        if code != 0 or "Traceback" in server.err.text:
            tally.find("all", f"the server ended with {code}: {server.err.text[-2000:]}")
    finally:
        server.kill()
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
