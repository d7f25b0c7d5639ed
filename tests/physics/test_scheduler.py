"""When timers and alarms fire."""

from fractions import Fraction
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from scheduling import Clocked

from mjplug.physics.scheduler import NEVER, Scheduler
from mjplug.physics.step_time import StepTime, as_fraction


def test_a_100_hz_timer_at_2_ms_fires_every_5_steps_for_ever():
    scheduler, fired, now = Clocked(), [], 0
    scheduler.every(StepTime(0.002).steps_per(0.01), lambda: fired.append(now), start=0)
    for now in range(1, 100_001):
        if scheduler.next_due <= now:
            scheduler.run_due(now)
    assert fired == list(range(5, 100_001, 5))


@given(rate=st.integers(1, 500), timestep=st.sampled_from([0.001, 0.002, 0.005, 1 / 240, 0.0003]))
def test_a_rate_that_does_not_divide_keeps_its_phase_and_its_mean(rate, timestep):
    scheduler, fired = Clocked(), []
    per_period = StepTime(timestep).steps_per(1 / rate)
    now = 0
    scheduler.every(per_period, lambda: fired.append(now), start=0)
    for now in range(1, 3000):
        if scheduler.next_due <= now:
            scheduler.run_due(now)
    per_period = max(per_period, Fraction(1))
    for k, step in enumerate(fired, start=1):
        assert 0 <= step - k * per_period < 1
    assert len(fired) == int(2999 / per_period)


def test_thirty_hertz_is_understood_as_exactly_one_thirtieth():
    assert as_fraction(1 / 30.0) == Fraction(1, 30)
    assert as_fraction(0.002) == Fraction(1, 500)
    assert as_fraction(0.0041666666666667) == Fraction(1, 240)


@given(st.floats(1e-9, 1e3))
def test_a_step_length_is_never_changed_by_more_than_a_relative_1e_10(seconds):
    assert abs(as_fraction(seconds) - Fraction(seconds)) <= Fraction(seconds) / 10**10


@given(step=st.integers(0, 10**12))
def test_simulated_time_of_2_ms_steps_is_exact_after_a_trillion_steps(step):
    assert StepTime(0.002).ns(step) == step * 2_000_000


def test_time_is_rounded_to_the_nearest_nanosecond():
    time = StepTime(1 / 3)
    assert [time.ns(k) for k in range(4)] == [0, 333_333_333, 666_666_667, 1_000_000_000]


@given(duration=st.integers(0, 10**12), timestep=st.sampled_from([0.001, 0.002, 1 / 240, 1 / 3]))
def test_steps_covering_is_the_smallest_number_that_covers(duration, timestep):
    time = StepTime(timestep)
    n = time.steps_covering(duration)
    assert n * time.timestep * 10**9 >= duration
    assert n == 0 or (n - 1) * time.timestep * 10**9 < duration


def test_timers_due_at_the_same_step_fire_in_the_order_of_their_creation():
    scheduler, order = Clocked(), []
    scheduler.every(Fraction(6), lambda: order.append("a"), 0)
    scheduler.every(Fraction(2), lambda: order.append("b"), 0)
    scheduler.every(Fraction(3), lambda: order.append("c"), 0)
    scheduler.run_due(5)
    order.clear()
    scheduler.run_due(6)
    assert order == ["a", "b", "c"]


def test_a_period_below_one_step_fires_at_every_step():
    scheduler, fired = Clocked(), []
    scheduler.every(Fraction(1, 7), lambda: fired.append(1), 0)
    for step in range(1, 11):
        scheduler.run_due(step)
    assert len(fired) == 10


def test_a_cancelled_timer_fires_no_more_and_is_forgotten():
    scheduler, fired = Clocked(), []
    timer = scheduler.every(Fraction(1), lambda: fired.append(1), 0)
    scheduler.run_due(1)
    timer.cancel()
    scheduler.run_due(2)
    assert fired == [1]
    assert scheduler.next_due == NEVER


def test_a_reset_restarts_the_phase_of_every_timer():
    scheduler, fired, now = Clocked(), [], 0
    scheduler.every(Fraction(5), lambda: fired.append(now), 0)
    for now in range(1, 8):
        scheduler.run_due(now)
    scheduler.rephase(7)
    for now in range(8, 20):
        scheduler.run_due(now)
    assert fired == [5, 12, 17]


def test_an_unwanted_timer_sleeps_and_wakes_in_its_old_phase():
    scheduler, fired, has_subscriber, now = Clocked(), [], [True], 0
    timer = scheduler.every(Fraction(10, 3), lambda: fired.append(now), 0, while_true=lambda: has_subscriber[0])
    for now in range(1, 8):
        scheduler.run_due(now)
    has_subscriber[0] = False
    for now in range(8, 30):
        scheduler.run_due(now)
    assert fired == [4, 7]
    assert scheduler.next_due == NEVER
    has_subscriber[0] = True
    scheduler.wake(timer, 29)
    scheduler.wake(timer, 29)
    for now in range(30, 41):
        scheduler.run_due(now)
    assert fired == [4, 7, 30, 34, 37, 40]


def test_an_alarm_fires_once_at_its_step_before_requests_that_came_later():
    steps = [0]
    scheduler = Scheduler(lambda: steps[0])
    order = []
    alarm = scheduler.alarm(lambda: order.append(("alarm", steps[0])))

    def wait():
        yield 5
        order.append(("request", steps[0]))

    answer = SimpleNamespace(respond=lambda response: None, refuse=lambda reason: None)
    scheduler.start(wait(), answer)
    alarm.set(5)
    assert scheduler.next_due == 5
    for step in range(1, 8):
        steps[0] = step
        scheduler.run_due(step)
    assert order == [("alarm", 5), ("request", 5)]


def test_an_alarm_can_be_set_again_and_stopped():
    scheduler, fired = Scheduler(lambda: 0), []
    alarm = scheduler.alarm(lambda: fired.append(True))
    alarm.set(3)
    alarm.stop()
    # Twice the same entry in the heap.
    alarm.set(3)
    scheduler.run_due(3)
    assert fired == [True]
    alarm.set(10)
    alarm.set(6)
    scheduler.run_due(6)
    assert fired == [True, True]
    scheduler.run_due(10)
    assert fired == [True, True]
    alarm.set(12)
    alarm.set(20)
    scheduler.run_due(12)
    assert fired == [True, True]


def test_alarms_survive_a_reset_and_a_restore():
    scheduler, fired = Scheduler(lambda: 0), []
    alarm = scheduler.alarm(lambda: fired.append(True))
    alarm.set(9)
    scheduler.rephase(4)
    scheduler.restore(2, {})
    assert scheduler.next_due == 9
    scheduler.run_due(9)
    assert fired == [True]


def test_timers_continue_their_phases_and_others_start_anew():
    scheduler, fired = Scheduler(lambda: 0), []
    one = scheduler.every(Fraction(10), lambda: fired.append("one"), 0)
    scheduler.every(Fraction(10), lambda: fired.append("two"), 0)
    scheduler.run_due(10)
    fired.clear()
    scheduler.restore(104, {one: (96, False)})
    for step in range(104, 117):
        scheduler.run_due(step)
    assert fired == ["one", "two", "one"]
    # A firing at the present step that has not happened yet.
    fired.clear()
    scheduler.restore(50, {one: (40, True)})
    scheduler.run_due(50)
    assert fired == ["one"]
