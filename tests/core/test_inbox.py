import threading

from mjplug.core.inbox import Inbox


def test_a_short_wait_ends_even_if_the_call_before_it_was_drained():
    """`SimpleQueue.get` of Python before 3.13 does not, about once in a thousand times."""
    inbox, ran = Inbox(), []

    def go_on():
        for number in range(10_000):
            inbox.post(lambda number=number: ran.append(number))
            inbox.drain(1.0)
            inbox.wait(1e-6)

    thread = threading.Thread(target=go_on, daemon=True)
    thread.start()
    thread.join(60.0)
    assert not thread.is_alive()
    assert ran == list(range(10_000))


def test_a_call_that_is_posted_ends_a_wait():
    inbox, ran = Inbox(), []
    waiting = threading.Thread(target=inbox.wait, args=(60.0,), daemon=True)
    waiting.start()
    inbox.post(lambda: ran.append(threading.current_thread()))
    waiting.join(30.0)
    assert ran == [waiting]
