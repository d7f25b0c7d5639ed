"""Clients that die and clients that send too many requests: all get a reply, and the server continues."""

import json
import subprocess
import sys
import textwrap

from cli.client import JSON, wrench, wrenches
from cli.process import environment

CLIENT = """
    import json, sys, threading, zenoh
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    session = zenoh.open(config)
    session.declare_subscriber("**", print)
    request = {"wrenches": {"external_wrenches": [
        {"wrench": {"header": {"frame_id": "link_a"}}, "duration": {"sec": 1000}}]}}
    for _ in range(20):
        session.get("external_wrench/apply_wrench", print, payload=json.dumps(request), timeout=1000.0)
    list(session.get("mjplug/set_pause"))
    print("waiting", flush=True)
    threading.Event().wait()
"""


def test_a_client_that_dies_while_it_waits_leaves_no_trace(target):
    command = [sys.executable, "-c", textwrap.dedent(CLIENT), target.server.endpoint]
    client = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
    try:
        while "waiting" not in client.stdout.readline():
            assert client.poll() is None
    finally:
        client.kill()
        client.communicate()


def test_three_hundred_requests_at_once_are_all_answered(target):
    body = json.dumps(wrenches(wrench("link_a", seconds=0.1)))
    pending = [target.client.send("external_wrench/apply_wrench", body, JSON) for _ in range(300)]
    messages = [one.answer().json for one in pending]
    assert messages == [{"success": True, "message": "applied 1 wrench, the longest for 0.1 s"}] * 300


def test_more_requests_than_can_wait_are_refused_and_a_reset_answers_the_rest(attacked):
    client = attacked.client
    client.do("mjplug/set_pause", paused=True)
    body = json.dumps(wrenches(wrench("link_a", seconds=1000.0)))
    pending = [client.send("external_wrench/apply_wrench", body, JSON, timeout=60.0) for _ in range(4200)]
    client.do("mjplug/reset_world")
    reasons = [one.answer().sentence for one in pending]
    # Before anything can fail: later tests share this server.
    assert client.do("mjplug/set_pause", paused=False) == "the simulation is now running"
    cancelled = [reason for reason in reasons if reason == "cancelled: the world was reset"]
    refused = [
        reason for reason in reasons if "at most 1000 can be active at the same time" in reason or "busy: " in reason
    ]
    assert len(cancelled) + len(refused) == 4200
    assert len(cancelled) == 1000
