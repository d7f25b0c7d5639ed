"""The status `topics`, on real Zenoh."""

import threading

import pytest
from waits import TIMEOUT

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import DEFAULT, LATCHED, Topic
from mjplug.wire.topic_rates import TopicRates
from mjplug_schemas.std_msgs import Float64


def test_the_rates_of_topics_with_subscribers_are_reported(network, client):
    appeared = threading.Event()
    heard = network.open_publisher(Topic("/heard", Float64, DEFAULT), appeared.set)
    twin = network.open_publisher(Topic("/heard", Float64, DEFAULT))
    unheard = network.open_publisher(Topic("/unheard", Float64, DEFAULT))
    latched, untouched = (network.open_publisher(Topic(name, Float64, LATCHED)) for name in ("/latched", "/untouched"))
    subscriber = client.session.declare_subscriber("heard")
    assert appeared.wait(TIMEOUT)
    rates = TopicRates(network, 10.0)
    for _ in range(30):
        heard.publish(Float64())
        unheard.publish(Float64())
    for publisher in (heard, twin, latched):
        publisher.publish_frame(CdrFrame(Float64()))
    rates.refresh(12.0)
    said = rates.diagnose()
    assert said.values == {"/heard (Hz)": pytest.approx(16.0), "/latched (Hz)": pytest.approx(0.5)}
    assert said.message == "16.5 messages per second on 2 topics"
    assert not untouched.sent
    rates.refresh(13.0)
    assert rates.diagnose().values == {"/heard (Hz)": 0.0}
    subscriber.undeclare()


def test_what_a_worker_publishes_is_not_counted_as_nothing(network, client):
    appeared = threading.Event()
    publisher = network.open_publisher(Topic("/image", Float64, DEFAULT), appeared.set)
    subscriber = client.session.declare_subscriber("image")
    assert appeared.wait(TIMEOUT)
    rates = TopicRates(network, 0.0)
    publisher.remote_spec()
    rates.refresh(1.0)
    assert rates.diagnose().values == {}
    subscriber.undeclare()
