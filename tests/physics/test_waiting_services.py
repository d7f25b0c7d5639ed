"""Services that wait for simulated time or for an event."""

from types import SimpleNamespace

import pytest
from scheduling import Answers, Clocked

from mjplug.errors import RequestError
from mjplug.physics.scheduler import NEVER, Event, Scheduler
from mjplug_schemas.std_msgs import String


def test_a_slow_service_continues_at_its_step_and_answers_once():
    scheduler, answers, seen = Clocked(), Answers(), []

    def work():
        seen.append("started")
        yield 3
        seen.append("went on")
        yield 5
        return String(data="done")

    scheduler.start(work(), answers)
    assert scheduler.next_due == 3
    scheduler.run_due(2)
    assert seen == ["started"]
    scheduler.run_due(3)
    assert seen == ["started", "went on"]
    assert not answers.responses
    scheduler.run_due(5)
    assert answers.responses == [String(data="done")]
    assert scheduler.next_due == NEVER


def test_a_slow_service_can_wait_for_an_event():
    scheduler, answers, event = Clocked(), Answers(), Event()

    def work():
        yield event
        return String(data="heard")

    scheduler.start(work(), answers)
    assert not answers.responses
    event.set()
    assert answers.responses == [String(data="heard")]


def test_closing_runs_finally_and_gives_the_reason():
    scheduler, answers, cleaned = Clocked(), Answers(), []

    def work():
        try:
            yield 10
        finally:
            cleaned.append(True)

    scheduler.start(work(), answers)
    scheduler.cancel("stopping")
    assert cleaned == [True]
    assert answers.refusals == ["stopping"]
    scheduler.run_due(10)
    assert answers.refusals == ["stopping"]
    assert not answers.responses


def test_a_request_whose_closing_lets_another_one_end_does_not_stop_the_closing():
    scheduler, first, second, third, event = Clocked(), Answers(), Answers(), Answers(), Event()

    def releases():
        try:
            yield 10
        finally:
            event.set()

    def released():
        yield event
        return String(data="released")

    def waits():
        yield 10

    for generator, answers in ((releases(), first), (released(), second), (waits(), third)):
        scheduler.start(generator, answers)
    scheduler.cancel("cancelled")
    assert first.refusals == third.refusals == ["cancelled"]
    assert second.responses == [String(data="released")]
    assert not second.refusals
    assert scheduler.waiting == 0


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (RequestError("no such body"), "no such body"),
        (ZeroDivisionError("oops"), "internal error: ZeroDivisionError('oops')"),
    ],
)
def test_an_error_while_waiting_reaches_the_client(error, reason):
    scheduler, answers = Clocked(), Answers()

    def work():
        yield 1
        raise error

    scheduler.start(work(), answers)
    scheduler.run_due(1)
    assert answers.refusals == [reason]


@pytest.mark.parametrize("wrong", [None, "x", [1], 0.5, float("nan")], ids=repr)
def test_a_service_that_yields_what_is_no_wait_is_refused_and_cleaned_up(wrong, caplog):
    scheduler, answers, cleaned = Clocked(), Answers(), []

    def work():
        try:
            yield wrong
        finally:
            cleaned.append(True)

    scheduler.start(work(), answers)
    scheduler.run_due(10)
    assert cleaned == [True]
    assert len(answers.refusals) == 1
    assert "a service yields step numbers (int) or events" in answers.refusals[0]


def test_a_wait_for_a_step_that_was_reached_continues_at_once():
    scheduler, answers, seen = Clocked(step=5), Answers(), []

    def work():
        for step in (0, 5, 7, 7, 3, 7, 9):
            yield step
            seen.append((step, scheduler.step))
        return String()

    scheduler.start(work(), answers)
    assert seen == [(0, 5), (5, 5)]
    scheduler.run_due(6)
    assert seen == [(0, 5), (5, 5)]
    scheduler.run_due(7)
    assert seen[2:] == [(7, 7), (7, 7), (3, 7), (7, 7)]
    scheduler.run_due(9)
    assert answers.responses == [String()]


def test_after_an_event_a_wait_counts_from_the_present_step():
    scheduler, answers, event = Clocked(), Answers(), Event()

    def work():
        yield event
        yield 40
        return String(data="at once")

    scheduler.start(work(), answers)
    # Nothing was due meanwhile, so that the scheduler was not called.
    scheduler.step = 50
    event.set()
    assert answers.responses == [String(data="at once")]
    assert scheduler.next_due == NEVER


def test_a_service_that_never_lets_time_advance_is_stopped(caplog):
    scheduler, answers, cleaned = Clocked(step=3), Answers(), []

    def work():
        try:
            while True:
                yield 3
        finally:
            cleaned.append(True)

    scheduler.start(work(), answers)
    assert cleaned == [True]
    assert answers.refusals == [
        "internal error: the service yielded 10000 steps or events in a row that were already past; "
        "yield `host.step + 1` to wait for the next step"
    ]
    assert scheduler.waiting == 0
    assert "a service was ended" in caplog.text


def test_a_request_that_was_closed_is_not_resumed_by_the_event_it_waited_for():
    scheduler, answers, event = Clocked(), Answers(), Event()

    def work():
        yield event
        return String()

    scheduler.start(work(), answers)
    scheduler.cancel("stopping")
    event.set()
    assert answers.refusals == ["stopping"]
    assert not answers.responses


def test_an_owner_can_end_its_own_requests_only():
    scheduler, mine, other = Clocked(), Answers(), Answers()

    def work():
        yield 10
        return String()

    scheduler.start(work(), mine, owner="me")
    scheduler.start(work(), other, owner="you")
    scheduler.cancel("switched off", owner="me")
    scheduler.run_due(10)
    assert mine.refusals == ["switched off"]
    assert other.responses == [String()]


def test_a_request_that_cancels_all_others_is_not_refused_itself():
    scheduler, answers = Scheduler(lambda: 0), []

    def wait():
        yield 10
        return "never"

    def cancel():
        scheduler.cancel("cancelled: a test")
        return "done"
        yield

    for handler in (wait, cancel):
        answer = SimpleNamespace(respond=answers.append, refuse=answers.append)
        scheduler.start(handler(), answer)
    assert answers == ["cancelled: a test", "done"]
    assert scheduler.waiting == 0
