"""Services on real Zenoh: one server on 127.0.0.1, clients that are plain Zenoh sessions."""

import logging
import queue
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import pytest
import zenoh
from waits import TIMEOUT

from mjplug.contracts.transport import ServiceName
from mjplug.errors import WireError
from mjplug.wire import queues
from mjplug.wire.replies import MAX_DIRECT, Replies
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation
from mjplug_schemas.std_srvs import Empty, SetBool, Trigger

YES = SetBool.Response(success=True, message="yes")
NO = SetBool.Response(success=False, message="no")
BRIDGE = b"rqh" + bytes(16) + b"\1"


def answer_directly(call):
    call.respond(YES if call.request.data else NO)


@pytest.fixture
def served(network):
    """A SetBool service that answers on Zenoh's thread."""
    network.open_service(ServiceName("/mjplug/switch", SetBool), answer_directly)
    return "mjplug/switch"


@pytest.mark.parametrize(
    ("payload", "encoding", "form", "expected"),
    [
        (SetBool.Request(data=True).to_cdr(), None, "cdr", YES),
        (SetBool.Request(data=True).to_cdr(), "application/cdr", "cdr", YES),
        (SetBool.Request(data=True).to_cdr(), "application/cdr;std_srvs/srv/SetBool", "cdr", YES),
        (SetBool.Request(data=True).to_cdr(), "application/cdr;std_srvs/srv/SetBool_Request", "cdr", YES),
        (b'{"data": true}', None, "json", YES),
        (b'{"data": true}', "application/json", "json", YES),
        (b"{}", None, "json", NO),
        (b"{}", "text/json", "json", NO),
        (b"", None, "json", NO),
        (None, None, "json", NO),
        (b"", "application/cdr", "cdr", NO),
    ],
)
def test_a_request_is_answered_in_its_own_form(client, served, payload, encoding, form, expected):
    answer = client.call(served, payload, encoding=encoding)
    assert answer.ok
    assert answer.key == served
    if form == "cdr":
        assert answer.encoding == "application/cdr;std_srvs/srv/SetBool_Response"
        assert answer.payload == expected.to_cdr()
    else:
        assert answer.encoding == "application/json"
        assert answer.json == expected.model_dump()


@pytest.mark.parametrize(
    ("payload", "encoding", "sentence"),
    [
        (b'{"data": 3}', None, "std_srvs/srv/SetBool_Request: data must be"),
        (b'{"dat": true}', None, "std_srvs/srv/SetBool_Request"),
        (b"\0\1\0\0\7", None, "std_srvs/srv/SetBool_Request"),
        (b"\xde\xad\xbe\xef", None, "the payload starts with de ad be ef, so it is neither CDR nor a JSON object"),
        (b"\0\1\0\0\1", "application/cdr;std_srvs/srv/Trigger", "the encoding states the type 'std_srvs/srv/Trigger'"),
        (
            b"\0\1\0\0\1",
            "image/png",
            "the encoding is 'image/png'; only application/cdr and application/json are accepted",
        ),
        (bytes(10 << 20), None, f"the payload has {10 << 20} bytes; at most {1 << 20} are accepted"),
    ],
)
def test_a_bad_request_gets_a_sentence_and_the_next_one_is_served(client, served, payload, encoding, sentence):
    answer = client.call(served, payload, encoding=encoding)
    assert not answer.ok
    assert answer.encoding == "text/plain"
    assert answer.text.startswith(sentence)
    assert client.call(served, b'{"data": true}').json == YES.model_dump()


def test_a_bad_request_of_a_ros_client_gets_an_error_response(client, served):
    answer = client.call(served, b"\0\1\0\0\7", attachment=BRIDGE)
    assert answer.ok
    response = SetBool.Response.from_cdr(answer.payload)
    assert response.success is False
    assert response.message.startswith("std_srvs/srv/SetBool_Request")


def test_a_ros_client_gets_a_response_even_where_the_type_cannot_say_that_it_failed(client, network, caplog):
    network.open_service(ServiceName("/empty", Empty), lambda call: call.refuse("not now"))
    answer = client.call("empty", b"\0\1\0\0\0", attachment=BRIDGE)
    assert answer.ok
    assert answer.payload == Empty.Response().to_cdr()
    assert any("std_srvs/srv/Empty has no field for a failure" in line for line in caplog.messages)


def test_a_refusal_is_a_response_where_the_type_can_report_it_and_an_error_otherwise(client, network):
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.refuse("not now"))
    network.open_service(ServiceName("/empty", Empty), lambda call: call.refuse("not now"))
    assert client.call("trigger").json == {"success": False, "message": "not now"}
    answer = client.call("trigger", b"\0\1\0\0\0")
    assert Trigger.Response.from_cdr(answer.payload) == Trigger.Response(success=False, message="not now")
    answer = client.call("empty")
    assert (answer.ok, answer.text, answer.encoding) == (False, "not now", "text/plain")


def test_the_parameters_of_the_selector_come_with_the_call(client, network):
    network.open_service(
        ServiceName("/trigger", Trigger),
        lambda call: call.respond(Trigger.Response(message=repr(sorted(call.parameters.items())))),
    )
    assert client.call("trigger?wait=false;note=a%20b;flag").json["message"] == repr(
        [("flag", ""), ("note", "a b"), ("wait", "false")]
    )
    assert client.call("trigger").json["message"] == "[]"


def test_threads_of_zenoh_keep_their_python_data_between_requests(client, network):
    calls, local = Counter(), threading.local()

    def answer(call):
        # Without a kept thread state, every callback sees an empty `local`.
        local.calls = getattr(local, "calls", 0) + 1
        calls[threading.get_ident()] += 1
        call.respond(Trigger.Response(success=local.calls == calls[threading.get_ident()]))

    network.open_service(ServiceName("/trigger", Trigger), answer)
    answers = [client.call("trigger").json["success"] for _ in range(50)]
    assert all(answers)
    # Zenoh has few threads, so that they keep little memory.
    assert len(calls) < 20


def test_a_query_for_many_keys_calls_no_service(client, network):
    calls = []
    network.open_service(ServiceName("/world/reset", Trigger), calls.append)
    client.settle()
    replies = list(client.session.get("world/*", target=zenoh.QueryTarget.ALL))
    sentence = "world/reset is a service; query exactly this key to call it"
    assert [bytes(reply.err.payload).decode() for reply in replies] == [sentence]
    assert calls == []


def test_three_hundred_requests_in_flight_are_all_answered_from_another_thread(client, network):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/step", StepSimulation), calls.put)
    client.settle()
    answers = queue.SimpleQueue()
    for i in range(300):
        client.session.get("step", answers.put, payload=StepSimulation.Request(steps=i).to_cdr(), timeout=TIMEOUT)

    def serve():
        waiting = [calls.get(timeout=TIMEOUT) for _ in range(300)]
        assert len(network.open_calls) == 300
        for call in reversed(waiting):
            call.respond(StepSimulation.Response(success=True, message=str(call.request.steps)))

    server = threading.Thread(target=serve)
    server.start()
    replies = [answers.get(timeout=TIMEOUT) for _ in range(300)]
    server.join(TIMEOUT)
    told = {int(StepSimulation.Response.from_cdr(bytes(reply.ok.payload)).message) for reply in replies}
    assert told == set(range(300))
    assert len(network.open_calls) == 0


def test_over_the_limit_a_client_gets_the_error_that_the_server_is_busy(new_network, client_of):
    network = new_network(max_open_calls=2)
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    client = client_of(network.session.endpoint)
    answers = queue.SimpleQueue()
    client.settle()
    for _ in range(2):
        client.session.get("trigger", answers.put)
        calls.get(timeout=TIMEOUT)
    assert client.call("trigger").json == {
        "success": False,
        "message": "busy: 2 requests are waiting, which is the maximum; try again later",
    }


def test_only_the_first_answer_counts(client, network):
    def answer_twice(call):
        call.respond(Trigger.Response(success=True, message="first"))
        call.respond(Trigger.Response(success=False, message="second"))
        call.refuse("third")

    network.open_service(ServiceName("/trigger", Trigger), answer_twice)
    assert client.call("trigger").json == {"success": True, "message": "first"}


def test_a_response_of_another_type_is_refused_and_the_call_stays_open(client, network):
    failures = []

    def answer(call):
        try:
            call.respond(Trigger.Request())
        except TypeError as error:
            failures.append(str(error))
        call.respond(Trigger.Response(success=True))

    network.open_service(ServiceName("/trigger", Trigger), answer)
    assert client.call("trigger").json["success"] is True
    assert failures == ["the response of std_srvs/srv/Trigger must be a std_srvs/srv/Trigger_Response, not Request"]


def test_a_deliver_that_fails_refuses_the_call(client, network, caplog):
    def deliver(call):
        raise RuntimeError("no room")

    network.open_service(ServiceName("/trigger", Trigger), deliver)
    assert client.call("trigger").json == {
        "success": False,
        "message": "internal error: delivering the request failed; see the server's log",
    }
    assert "service /trigger: delivering a request failed" in caplog.messages
    assert len(network.open_calls) == 0


def test_open_calls_are_answered_before_the_network_closes(client, network):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    answers = queue.SimpleQueue()
    client.settle()
    for _ in range(50):
        client.session.get("trigger", answers.put, timeout=TIMEOUT)
    held = [calls.get(timeout=TIMEOUT) for _ in range(50)]
    network.close("the server is stopping")
    for _ in range(50):
        reply = answers.get(timeout=TIMEOUT)
        assert reply.ok is not None
        assert Trigger.Response.from_json(bytes(reply.ok.payload)).message == "the server is stopping"
    held[0].respond(Trigger.Response(success=True))


def test_open_calls_can_be_refused_while_the_server_continues(client, network):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    answers = queue.SimpleQueue()
    client.settle()
    client.session.get("trigger", answers.put, timeout=TIMEOUT)
    calls.get(timeout=TIMEOUT)
    network.refuse_open_calls("the world was reset")
    reply = answers.get(timeout=TIMEOUT)
    assert Trigger.Response.from_json(bytes(reply.ok.payload)).message == "the world was reset"
    client.session.get("trigger", answers.put, timeout=TIMEOUT)
    calls.get(timeout=TIMEOUT).respond(Trigger.Response(success=True))
    assert Trigger.Response.from_json(bytes(answers.get(timeout=TIMEOUT).ok.payload)).success


VANISHING_CLIENT = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
print(session.get("trigger").recv())
"""


def test_a_client_that_vanishes_leaves_no_trace_but_a_debug_line(client, network, caplog):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    config = '{mode: "client", connect: {endpoints: ["%s"]}, scouting: {multicast: {enabled: false}}}'
    process = subprocess.Popen([sys.executable, "-c", VANISHING_CLIENT, config % network.session.endpoint])
    call = calls.get(timeout=TIMEOUT)
    process.kill()
    process.wait(TIMEOUT)
    with caplog.at_level(logging.INFO):
        call.respond(Trigger.Response(success=True))
    assert len(network.open_calls) == 0
    assert caplog.messages == []
    answers = queue.SimpleQueue()
    client.session.get("trigger", answers.put, timeout=TIMEOUT)
    calls.get(timeout=TIMEOUT).respond(Trigger.Response(success=True))
    assert answers.get(timeout=TIMEOUT).ok is not None


STOPPED_CLIENT = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
for _ in range(100):
    session.get("trigger", lambda reply: None)
print("sent", flush=True)
sys.stdin.read()
"""


def test_a_client_that_stops_reading_does_not_hold_up_who_answers(new_network, client_of, monkeypatch):
    # A reply that is sent from here would wait as long.
    monkeypatch.setattr(queues, "_BLOCK_TIMEOUT_US", int(1e6 * TIMEOUT))
    network = new_network()
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    config = '{mode: "client", connect: {endpoints: ["%s"]}, scouting: {multicast: {enabled: false}}}'
    command = [sys.executable, "-c", STOPPED_CLIENT, config % network.session.endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        held = [calls.get(timeout=TIMEOUT) for _ in range(100)]
        process.send_signal(signal.SIGSTOP)
        response = Trigger.Response(success=True, message="x" * 100_000)
        start = time.monotonic()
        for call in held:
            call.respond(response)
        # Far more than the sockets buffer.
        assert time.monotonic() - start < TIMEOUT / 2
        process.kill()
    client, answers = client_of(network.session.endpoint), queue.SimpleQueue()
    client.session.get("trigger", answers.put, timeout=TIMEOUT)
    calls.get(timeout=TIMEOUT).respond(Trigger.Response(success=True))
    assert answers.get(timeout=TIMEOUT).ok is not None


def test_short_replies_are_sent_by_a_thread_that_may_wait():
    replies, threads = Replies(), []

    def send():
        threads.append(threading.current_thread().name)

    here = threading.current_thread().name
    replies.post(send)
    replies.close()
    assert threads == ["mjplug-replies"]
    replies = Replies()
    replies.may_wait = lambda: True
    replies.post(send, MAX_DIRECT)
    assert threads == ["mjplug-replies", here]
    replies.post(send, MAX_DIRECT + 1)
    replies.close()
    assert threads == ["mjplug-replies", here, "mjplug-replies"]


def test_a_thread_that_may_wait_continues_after_a_client_that_stops_reading(network, client):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    network.open_calls.replies.may_wait = lambda: True
    config = '{mode: "client", connect: {endpoints: ["%s"]}, scouting: {multicast: {enabled: false}}}'
    command = [sys.executable, "-c", STOPPED_CLIENT, config % network.session.endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        held = [calls.get(timeout=TIMEOUT) for _ in range(100)]
        process.send_signal(signal.SIGSTOP)
        for call in held:
            call.respond(Trigger.Response(success=True, message="x" * 60_000))
        process.kill()
    assert len(network.open_calls) == 0
    answers = queue.SimpleQueue()
    client.session.get("trigger", answers.put, timeout=TIMEOUT)
    calls.get(timeout=TIMEOUT).respond(Trigger.Response(success=True))
    assert answers.get(timeout=TIMEOUT).ok is not None


def test_a_service_is_offered_once(network):
    network.open_service(ServiceName("/trigger", Trigger), print)
    with pytest.raises(WireError, match="the service /trigger already exists; give one of the two another name"):
        network.open_service(ServiceName("/trigger", Empty), print)
