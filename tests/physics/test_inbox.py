import threading
import time

from mjplug.physics.inbox import MIN_REPORTED_OVERRUNS, REPORT_INTERVAL, Inbox


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


def test_a_drain_that_runs_out_of_time_leaves_the_rest_and_is_counted():
    inbox, ran = Inbox(), []
    for number in range(3):
        inbox.post(lambda number=number: (ran.append(number), time.sleep(0.002)))
    inbox.drain(0.001)
    assert (ran, inbox.waiting, inbox.overfull, inbox.overruns) == ([0], 2, True, 1)
    inbox.drain(60.0)
    assert (ran, inbox.waiting, inbox.overfull, inbox.overruns) == ([0, 1, 2], 0, False, 1)


def test_a_flood_has_one_line_in_the_log_for_each_span_and_a_few_slow_calls_have_none(caplog):
    inbox = Inbox()
    inbox.overruns += MIN_REPORTED_OVERRUNS - 1
    inbox.report_overruns(100.0)
    assert caplog.messages == []
    for second in range(30):
        inbox.overruns += MIN_REPORTED_OVERRUNS
        inbox.report_overruns(101.0 + second)
    assert len(caplog.messages) == 30 / REPORT_INTERVAL
    assert "requests and messages arrive faster than they can be handled: 0 are waiting" in caplog.messages[0]
    assert caplog.messages[1].endswith("(9 more since the last line)")
