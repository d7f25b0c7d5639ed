"""Ctrl-C while a thread waits for something that a thread of Zenoh reports: at each point, nothing stays locked."""

import contextlib
import types
from collections.abc import Callable
from dataclasses import dataclass

import pytest
import zenoh
from interrupts import ends, interrupted_at_each_point

from mjplug.client import ClientError
from mjplug.client.client import Client
from mjplug.client.errors import TimedOutError
from mjplug.client.publisher import Publisher
from mjplug.client.subscription import Subscription
from mjplug.view import recorder
from mjplug.wakeup import Flag, Wakeup
from mjplug_schemas.std_msgs import String

BRIEFLY = 1e-3
SAMPLE = types.SimpleNamespace(kind=zenoh.SampleKind.PUT, payload=zenoh.ZBytes(b"x"), attachment=None)


@dataclass
class Case:
    """Something that one thread waits for and another one reports."""

    wait: Callable[[], object]
    report: Callable[[], object]
    again: Callable[[], object]


def next_message():
    subscription = Subscription("/x", bytes, 1)

    def wait():
        with contextlib.suppress(TimedOutError):
            subscription.next(BRIEFLY)

    return Case(wait, lambda: subscription._receive(SAMPLE), wait)


def latest_message():
    subscription = Subscription("/x", bytes, 1)
    return Case(
        lambda: subscription.latest(BRIEFLY),
        lambda: subscription._receive(SAMPLE),
        lambda: setattr(subscription, "_newest", None),
    )


def flag():
    flag = Flag()
    return Case(lambda: flag.wait(BRIEFLY), flag.set, flag.clear)


def frames():
    waiting = recorder._Waiting()
    return Case(lambda: waiting.take(BRIEFLY), lambda: waiting.put(SAMPLE), lambda: waiting.take(0.0))


@pytest.mark.parametrize("make", [next_message, latest_message, flag, frames])
@pytest.mark.parametrize("reported", [False, True])
def test_what_is_reported_after_ctrl_c_does_not_block(make, reported):
    case = make()
    if reported:
        case.report()
    for point in interrupted_at_each_point(case.wait):
        assert ends(case.report), point
        case.again()
        if reported:
            case.report()
    assert point > 20


def test_a_wait_that_was_interrupted_leaves_nothing_behind():
    wakeup = Wakeup()
    left = 0
    for _ in interrupted_at_each_point(lambda: wakeup.wait_for(lambda: False, BRIEFLY)):
        left += len(wakeup._waiting)
        wakeup._waiting.clear()
    # Only an interrupt between the end of the wait and the removal leaves a lock, which nobody waits for.
    assert left < 40


def test_a_subscription_that_was_interrupted_while_it_closed_can_be_closed():
    subscriptions = []

    def close():
        subscriptions.append(Subscription("/x", bytes, 1))
        subscriptions[-1].close()

    for point in interrupted_at_each_point(close):
        if subscriptions:
            assert ends(subscriptions[-1].close), point
            assert subscriptions[-1].closed


@pytest.fixture(scope="module")
def session():
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    with zenoh.open(config) as session:
        yield session


def test_a_publisher_that_was_interrupted_while_it_sent_can_be_closed(session):
    publishers = []

    def publish():
        publisher = Publisher(session, "/x", "x", String)
        publishers.append(publisher)
        publisher.publish(String(data="x"))

    for _ in interrupted_at_each_point(publish):
        if publishers:
            publishers.pop().close()


class Refusing:
    """A session that cannot be closed, as when a callback never returns."""

    def is_closed(self):
        return False

    def close(self):
        raise zenoh.ZError("close operation timed out!")


def test_a_session_that_cannot_be_closed_does_not_replace_ctrl_c():
    with pytest.raises(KeyboardInterrupt) as raised, Client(Refusing(), "tcp/127.0.0.1:7"):
        raise KeyboardInterrupt
    assert raised.value.__notes__ == [
        "the session with tcp/127.0.0.1:7 could not be closed: close operation timed out!"
    ]


def test_a_session_that_cannot_be_closed_is_an_error_of_the_client():
    client = Client(Refusing(), "tcp/127.0.0.1:7")
    with pytest.raises(ClientError, match=r"the session with tcp/127\.0\.0\.1:7 could not be closed: close operation"):
        client.close()
    client.close()
