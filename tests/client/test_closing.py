"""Closing a client: what stops, when, and the errors of later calls."""

import math
import threading

import pytest
from waits import TIMEOUT

from mjplug.client import ClientError, connect
from mjplug.client import client as client_module
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String

SUBSCRIPTIONS = 25
"""By each of several threads."""


def test_using_a_closed_client_is_an_error(server):
    client = connect(server.endpoint)
    clock, chatter = client.subscribe("/clock", Clock), client.publisher("/chatter", String)
    client.close()
    client.close()
    assert clock.closed
    assert chatter.closed
    with pytest.raises(ClientError, match=r"the publisher of /chatter is closed"):
        chatter.publish(String())
    for use in (
        lambda: client.subscribe("/clock", Clock),
        lambda: client.publisher("/chatter", String),
        lambda: client.call("/mjplug/set_pause"),
        lambda: client.wait_for("/clock"),
        client.topics,
    ):
        with pytest.raises(ClientError, match=rf"the client of {server.endpoint} is closed"):
            use()


def test_closing_ends_the_waits_of_all_threads(server):
    client = connect(server.endpoint)
    opened, ended = threading.Barrier(5), []

    def listen():
        mine = [client.subscribe("/nobody", String) for _ in range(SUBSCRIPTIONS)]
        opened.wait(TIMEOUT)
        for subscription in mine:
            ended.append(list(subscription))

    threads = [threading.Thread(target=listen, daemon=True) for _ in range(4)]
    for thread in threads:
        thread.start()
    opened.wait(TIMEOUT)
    client.close()
    for thread in threads:
        thread.join(TIMEOUT)
    assert ended == [[]] * 4 * SUBSCRIPTIONS


def test_a_publisher_may_be_closed_while_another_thread_sends(client):
    publisher, begun, refused = client.publisher("/chatter", String), threading.Event(), []

    def send():
        try:
            while True:
                publisher.publish(String(data="x" * 10_000))
                begun.set()
        except ClientError as error:
            refused.append(str(error))

    sending = threading.Thread(target=send, daemon=True)
    sending.start()
    assert begun.wait(TIMEOUT)
    publisher.close()
    sending.join(TIMEOUT)
    assert refused == ["the publisher of /chatter is closed"]


def test_a_callback_may_close_the_client(server):
    client, done = connect(server.endpoint), threading.Event()

    def callback(message):
        client.close()
        done.set()

    subscription = client.subscribe("/clock", Clock, callback)
    assert done.wait(TIMEOUT)
    assert subscription.closed


def test_a_callback_may_close_the_client_before_publishers_are_awaited(server, monkeypatch):
    client = connect(server.endpoint)
    wait = client_module.await_publishers

    def closed_first(*arguments):
        client.close()
        wait(*arguments)

    monkeypatch.setattr(client_module, "await_publishers", closed_first)
    assert client.subscribe("/clock", Clock, lambda message: None).closed


def test_timeouts_can_be_infinite_but_not_negative(client):
    with client.subscribe("/clock", Clock) as clock:
        assert isinstance(clock.next(math.inf), Clock)
        assert isinstance(clock.latest(math.inf), Clock)
        assert client.publisher("/cmd_vel").wait_for_subscriber(math.inf)
        assert client.call("~/set_pause", paused=False, timeout=math.inf).success
        assert client.call("~/set_pause", paused=False, timeout=1e12).success
        for wrong in (-1.0, math.nan):
            for wait in (
                lambda wrong=wrong: clock.next(wrong),
                lambda wrong=wrong: clock.latest(wrong),
                lambda wrong=wrong: client.call("~/set_pause", timeout=wrong),
                lambda wrong=wrong: client.wait_for("/later", wrong),
                lambda wrong=wrong: client.publisher("/x", String).wait_for_subscriber(wrong),
                lambda wrong=wrong: connect(client.endpoint, timeout=wrong),
            ):
                with pytest.raises(ClientError, match=rf"the timeout is {wrong}"):
                    wait()


def test_a_queue_has_room_for_a_message(client):
    with pytest.raises(ClientError, match=r"depth is 0"):
        client.subscribe("/clock", Clock, depth=0)
