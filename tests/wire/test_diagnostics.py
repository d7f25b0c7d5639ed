"""The status `wire`, on real Zenoh."""

import queue
import threading

import zenoh
from waits import TIMEOUT

from mjplug.contracts.diagnostics import Level
from mjplug.contracts.transport import DEFAULT, ServiceName, Topic
from mjplug.wire.calls import MAX_SMALL_REQUEST, OpenCalls, WireCall
from mjplug.wire.diagnostics import WireDiagnostics
from mjplug_schemas.std_msgs import Float64
from mjplug_schemas.std_srvs import SetBool


def test_what_cannot_be_read_is_counted_and_warned_of_once(network, client):
    heard = threading.Event()
    network.open_subscription(Topic("/robot1/target", Float64, DEFAULT), lambda message: heard.set())
    network.open_service(ServiceName("/robot1/switch", SetBool), lambda call: None)
    health = WireDiagnostics(network)
    endpoint = network.session.endpoint
    quiet = {
        "endpoint": endpoint,
        "open requests": 0,
        "bytes of open requests": 0,
        "answers lost": 0,
        "refused": 0,
        "refused as busy": 0,
    }
    said = health.diagnose()
    assert (said.level, said.message, said.values) == (Level.OK, f"reachable at {endpoint}", quiet)

    publisher = client.publisher("robot1/target")
    for payload in (b"rubbish", b'{"data": "no number"}', b'{"data": 1.0}'):
        publisher.put(payload, encoding=zenoh.Encoding.APPLICATION_JSON)
    assert heard.wait(TIMEOUT)
    (answer,) = client.ask("robot1/switch", b'{"data": 5}', encoding=zenoh.Encoding.APPLICATION_JSON)
    assert not answer.ok

    counts = {"refused": 3, "refused on /robot1/target": 2, "refused on /robot1/switch": 1}
    said = health.diagnose()
    assert said.level == Level.WARN
    assert said.message == "3 messages or requests could not be read; the log says why"
    assert said.values == quiet | counts
    said = health.diagnose()
    assert (said.level, said.values) == (Level.OK, quiet | counts)


def test_requests_that_wait_are_counted(network, client):
    taken = threading.Event()
    calls = []

    def take(call):
        calls.append(call)
        taken.set()

    network.open_service(ServiceName("/robot1/switch", SetBool), take)
    health = WireDiagnostics(network)
    thread = threading.Thread(target=client.ask, args=("robot1/switch", b"{}"), kwargs={"encoding": "application/json"})
    thread.start()
    assert taken.wait(TIMEOUT)
    assert health.diagnose().values["open requests"] == 1
    calls[0].refuse("enough")
    thread.join(TIMEOUT)
    assert health.diagnose().values["open requests"] == 0


def test_requests_that_are_refused_as_busy_are_counted_and_warned_of_once(new_network, client_of, caplog):
    network = new_network(max_open_calls=1)
    client = client_of(network.session.endpoint)
    taken = threading.Event()
    network.open_service(ServiceName("/robot1/switch", SetBool), lambda call: taken.set())
    health = WireDiagnostics(network)
    client.settle()
    client.session.get("robot1/switch", lambda reply: None, payload=b"{}", encoding="application/json")
    assert taken.wait(TIMEOUT)
    for _ in range(3):
        answer = client.call("robot1/switch", b"{}", encoding="application/json")
        assert answer.json == {
            "success": False,
            "message": "busy: 1 requests are waiting, which is the maximum; try again later",
        }
    said = health.diagnose()
    assert (said.level, said.message) == (Level.WARN, "3 requests were refused as busy")
    assert said.values["refused as busy on /robot1/switch"] == said.values["refused as busy"] == 3
    assert health.diagnose().level == Level.OK
    about = "service /robot1/switch: a request was refused (1 so far): too many requests are waiting"
    assert [line for line in caplog.messages if "waiting" in line] == [about]


class Waiting:
    """A pending request of a given size."""

    needs_response = False
    parameters = {}  # noqa: RUF012

    def __init__(self, size):
        self.size = size
        self.replies = queue.SimpleQueue()

    def reply(self, payload, form):
        self.replies.put(SetBool.Response.from_cdr(payload))


def test_large_requests_that_wait_have_a_limit_in_bytes_and_small_ones_still_get_in():
    calls = OpenCalls(max_bytes=10_000)
    inquiries = [Waiting(size) for size in (5000, 5000, 5000, MAX_SMALL_REQUEST, MAX_SMALL_REQUEST)]
    waiting = [WireCall(raw, SetBool.Request(), "cdr", SetBool, calls) for raw in inquiries]
    assert [calls.admit(call) for call in waiting] == ["admitted", "admitted", "busy", "admitted", "admitted"]
    assert (len(calls), calls.bytes) == (4, 10_000)
    refused = inquiries[2].replies.get(timeout=TIMEOUT)
    assert refused.success is False
    assert refused.message.startswith("busy: the waiting requests have 10000 bytes; at most 10000 are accepted")
    waiting[0].respond(SetBool.Response(success=True))
    assert (len(calls), calls.bytes) == (3, 5000)
    again = WireCall(Waiting(5000), SetBool.Request(), "cdr", SetBool, calls)
    assert calls.admit(again) == "admitted"
    calls.close("the server is stopping")
    assert (len(calls), calls.bytes) == (0, 0)
    assert calls.admit(WireCall(Waiting(1), SetBool.Request(), "cdr", SetBool, calls)) == "closed"
