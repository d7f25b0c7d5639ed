"""The status `wire`, on real Zenoh."""

import threading

import zenoh

from mjplug.diagnosis import Level
from mjplug.transport import DEFAULT, ServiceName, Topic
from mjplug.wire.health import WireHealth
from mjplug_schemas.std_msgs import Float64
from mjplug_schemas.std_srvs import SetBool

PATIENCE = 5.0


def test_what_cannot_be_read_is_counted_and_warned_of_once(network, client):
    heard = threading.Event()
    network.open_subscription(Topic("/robot1/target", Float64, DEFAULT), lambda message: heard.set())
    network.open_service(ServiceName("/robot1/switch", SetBool), lambda call: None)
    health = WireHealth(network)
    endpoint = network.session.endpoint
    quiet = {"endpoint": endpoint, "open requests": 0, "answers lost": 0, "refused": 0}
    said = health.diagnose()
    assert (said.level, said.message, said.values) == (Level.OK, f"reachable at {endpoint}", quiet)

    publisher = client.publisher("robot1/target")
    for payload in (b"rubbish", b'{"data": "no number"}', b'{"data": 1.0}'):
        publisher.put(payload, encoding=zenoh.Encoding.APPLICATION_JSON)
    assert heard.wait(PATIENCE)
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
    health = WireHealth(network)
    thread = threading.Thread(target=client.ask, args=("robot1/switch", b"{}"), kwargs={"encoding": "application/json"})
    thread.start()
    assert taken.wait(PATIENCE)
    assert health.diagnose().values["open requests"] == 1
    calls[0].refuse("enough")
    thread.join(PATIENCE)
    assert health.diagnose().values["open requests"] == 0
