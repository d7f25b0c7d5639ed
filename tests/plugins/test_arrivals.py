import gc
import threading
import weakref

import pytest

from mjplug.physics.inbox import Inbox
from mjplug.plugin.arrivals import MAX_POSTED, Arrivals


class Message:
    def __init__(self, number):
        self.number = number


def test_a_flood_of_messages_that_are_not_taken_keeps_only_the_newest_and_a_few_calls():
    inbox, got = Inbox(), []
    arrivals = Arrivals("/words", 1, inbox, got.append)
    alive = []
    for number in range(10_000):
        message = Message(number)
        alive.append(weakref.ref(message))
        arrivals.deliver(message)
    del message
    gc.collect()
    assert inbox.waiting == MAX_POSTED
    assert sum(ref() is not None for ref in alive) == 1
    inbox.drain(60.0)
    assert [message.number for message in got] == [9999]
    assert inbox.replaced == {"/words": 9999}


@pytest.mark.parametrize("count", [1, 3, MAX_POSTED, MAX_POSTED + 1, 1000])
@pytest.mark.parametrize("depth", [1, 2, 10])
def test_the_newest_messages_are_delivered_in_order_and_once(count, depth):
    inbox, got = Inbox(), []
    arrivals = Arrivals("/words", depth, inbox, got.append)
    for rounds in (1, 2):
        for number in range(count):
            arrivals.deliver(number)
        inbox.drain(60.0)
        assert got == list(range(count))[-depth:] * rounds
        assert inbox.waiting == 0
    assert inbox.replaced.get("/words", 0) == 2 * max(0, count - depth)


def test_each_message_keeps_its_place_among_requests():
    inbox, order = Inbox(), []
    arrivals = Arrivals("/words", 10, inbox, order.append)
    for number in range(3):
        arrivals.deliver(number)
        inbox.post(lambda number=number: order.append(f"request {number}"))
    inbox.drain(60.0)
    assert order == [0, "request 0", 1, "request 1", 2, "request 2"]


def test_messages_from_several_threads_are_neither_lost_nor_repeated():
    inbox, got = Inbox(), []
    arrivals = Arrivals("/words", 1000, inbox, got.append)
    threads = [
        threading.Thread(target=lambda part=part: [arrivals.deliver((part, k)) for k in range(200)])
        for part in range(4)
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        inbox.drain(0.001)
    inbox.drain(60.0)
    assert sorted(got) == [(part, k) for part in range(4) for k in range(200)]
    for part in range(4):
        assert [k for p, k in got if p == part] == list(range(200))
