"""Servers that come, go and come back."""

import json
import signal
import threading

import pytest
from cli.client import Client
from waits import until

from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger

pytestmark = pytest.mark.ros

HEARTBEAT = "/own/mujoco_heartbeat"


def test_the_bridge_waits_for_the_server_and_survives_its_death(ros, serve, bridge, free_endpoint):
    own = bridge(free_endpoint)
    own.wait_for(f"waiting for a server at {free_endpoint}")
    inbox = ros.subscribe(HEARTBEAT, "std_msgs/msg/String")
    server = serve(listen=("--listen", free_endpoint))
    assert "Heartbeat #" in String.from_cdr(inbox.next()).data
    first = ros.call("/own/probe/state", "std_srvs/srv/Trigger")

    server.kill()
    own.wait_for("/mjplug stopped or cannot be reached; waiting for it")
    until(lambda: ros.types("/own/mjplug/epoch") == [])

    serve(listen=("--listen", free_endpoint))
    inbox.drain()
    assert "Heartbeat #" in String.from_cdr(inbox.next()).data
    again = ros.call("/own/probe/state", "std_srvs/srv/Trigger")
    assert json.loads(again.message)["time_ns"] < json.loads(first.message)["time_ns"] + 60e9
    assert own.process.poll() is None
    assert own.stop() == 0


def test_what_a_server_declares_later_is_mapped_too(ros, bridge, sim):
    own = bridge(sim.endpoint)
    own.wait_for("found /sim")
    for name, sentence in (("/go", "gone"), ("/stop", "stopped")):
        sim.responses[name] = Trigger.Response(success=True, message=sentence)
        sim.open_service(name)
        assert ros.call(f"/own{name}", "std_srvs/srv/Trigger").message == sentence


def test_calls_that_wait_fail_when_the_server_has_no_token_any_more(ros, bridge, sim):
    sim.open_service("/go")
    own = bridge(sim.endpoint)
    waiting = ros.send("/own/go", "std_srvs/srv/Trigger")
    until(lambda: sim.waiting == 1)
    sim.disappear()
    response = waiting.get()
    assert (response.success, response.message) == (False, "/sim stopped or cannot be reached")
    ready = ros.is_ready("/own/go", "std_srvs/srv/Trigger")
    until(lambda: not ready())
    own.wait_for("ERROR.*/own/go: /sim stopped or cannot be reached")


def test_a_server_that_is_not_ready_yet_is_asked_again_and_then_after_changes(ros, bridge, sim):
    own = bridge(sim.endpoint)
    listing = {
        "topics": [],
        "services": [{"name": "/go", "key": "go", "type": "std_srvs/srv/Trigger", "hash": type_hash(Trigger)}],
    }
    answers = [b"nonsense", json.dumps(listing).encode()]
    with Client(sim.endpoint) as late:
        token = late.session.liveliness().declare_token("@mjplug/late/1")
        own.wait_for("found /late")
        queryable = late.session.declare_queryable("late/interfaces", lambda query: reply(query, answers.pop(0)))
        own.wait_for("ERROR.*/late: the list of interfaces cannot be read")
        late.put("late/interfaces", b"")
        own.wait_for("/late: 0 topics and 1 services are mapped")
        ready = ros.is_ready("/own/go", "std_srvs/srv/Trigger")
        until(ready)
        answers.append(json.dumps({"topics": [], "services": []}).encode())
        late.put("late/interfaces", b"")
        until(lambda: not ready())
        token.undeclare()
        own.wait_for("/late stopped or cannot be reached")
        queryable.undeclare()
    assert answers == []


def test_when_a_server_stops_another_one_gets_its_names(ros, bridge, sim):
    sim.responses["/go"] = Trigger.Response(success=True, message="of the first")
    sim.open_service("/go")
    own = bridge(sim.endpoint)
    own.wait_for("/sim: 0 topics and 1 services are mapped")
    go = {"name": "/go", "key": "late/go", "type": "std_srvs/srv/Trigger", "hash": type_hash(Trigger)}
    listing = json.dumps({"topics": [], "services": [go]}).encode()
    response = Trigger.Response(success=True, message="of the second").to_cdr()
    with Client(sim.endpoint) as late:
        queryables = [
            late.session.declare_queryable("late/interfaces", lambda query: reply(query, listing)),
            late.session.declare_queryable("late/go", lambda query: reply(query, response)),
        ]
        token = late.session.liveliness().declare_token("@mjplug/late/1")
        own.wait_for("/own/go .* is not mapped: another server uses the same name")
        assert ros.call("/own/go", "std_srvs/srv/Trigger").message == "of the first"
        sim.disappear()
        own.wait_for("/sim stopped or cannot be reached")
        assert ros.call("/own/go", "std_srvs/srv/Trigger").message == "of the second"
        token.undeclare()
        for queryable in queryables:
            queryable.undeclare()


def test_the_end_of_an_earlier_start_is_not_taken_for_that_of_the_server(bridge, sim):
    own = bridge(sim.endpoint)
    with Client(sim.endpoint) as late:
        declare = late.session.liveliness().declare_token
        first = declare("@mjplug/late/1")
        own.wait_for("found /late")
        second, marker = declare("@mjplug/late/2"), declare("@mjplug/marker/1")
        own.wait_for("found /marker")
        first.undeclare()
        marker.undeclare()
        own.wait_for("/marker stopped or cannot be reached")
        nothing = json.dumps({"topics": [], "services": []}).encode()
        asked = threading.Event()

        def answer(query):
            reply(query, nothing)
            asked.set()

        queryable = late.session.declare_queryable("late/interfaces", answer)
        assert asked.wait(10.0)
        queryable.undeclare()
        second.undeclare()
        own.wait_for("/late stopped or cannot be reached")


def reply(query, payload):
    with query:
        query.reply(query.key_expr, payload)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_the_bridge_while_it_waits_and_while_it_works(bridge, serve, free_endpoint, number):
    assert bridge_ends(bridge(free_endpoint), "waiting for a server", number) == 0
    server = serve()
    assert bridge_ends(bridge(server.endpoint), "are mapped", number) == 0


def bridge_ends(bridge, pattern, number):
    bridge.wait_for(pattern)
    return bridge.stop(number)


def test_signals_that_repeat_while_the_bridge_closes_do_not_keep_it_from_its_end(bridge, sim):
    sim.open_service("/go")
    own = bridge(sim.endpoint)
    own.wait_for("are mapped")
    while own.process.poll() is None:
        own.process.send_signal(signal.SIGINT)
        threading.Event().wait(0.002)
    assert own.end() == 0
    assert "Traceback" not in own.log.text
