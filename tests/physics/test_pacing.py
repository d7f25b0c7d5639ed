import pytest

from mjplug.limits import MAX_SPEED, MAX_TIMESTEP, MIN_SPEED, MIN_TIMESTEP
from mjplug.physics.pacing import MAX_LAG, REPORT_INTERVAL, Pacer
from mjplug.physics.step_time import StepTime


def pacer(speed=1.0, timestep=0.002):
    pacer = Pacer(StepTime(timestep), speed)
    pacer.anchor(100, 50.0)
    return pacer


def test_steps_fall_due_at_absolute_deadlines():
    assert pacer().deadline(100) == 50.0
    assert pacer().deadline(600) == pytest.approx(51.0)
    assert pacer().due(100, 50.0079) == 103
    assert pacer().due(103, 50.0079) == 103


def test_the_speed_factor_scales_deadlines():
    assert pacer(speed=2.0).deadline(600) == pytest.approx(50.5)
    assert pacer(speed=0.1).deadline(101) == pytest.approx(50.02)


def test_a_deadline_that_has_just_come_is_due_in_spite_of_rounding():
    p = pacer()
    for step in range(100, 5000):
        assert p.due(step, p.deadline(step + 1)) == step + 1


def test_small_lag_is_caught_up_and_large_lag_is_dropped_and_counted(caplog):
    p = pacer()
    assert p.due(100, 50.05) == 125
    assert p.dropped == 0.0
    assert p.due(100, 51.0) == 151
    assert p.dropped == pytest.approx(0.898)
    assert p.deadline(151) == pytest.approx(51.0)
    assert "physics cannot keep up: 0.9 s" in caplog.text
    assert MAX_LAG == 0.1


def test_short_steps_are_not_woken_up_for_one_by_one():
    assert pacer(timestep=0.0001).steps_per_wake == 10
    assert pacer(timestep=0.002).steps_per_wake == 1
    assert pacer(timestep=0.0001, speed=10.0).steps_per_wake == 100


@pytest.mark.parametrize("speed", [MIN_SPEED, 1.0, MAX_SPEED])
@pytest.mark.parametrize("timestep", [MIN_TIMESTEP, 0.002, MAX_TIMESTEP])
@pytest.mark.parametrize("lag", [0.0, 1e-9, 0.05, 1e3, 1e6])
def test_every_allowed_speed_and_time_step_can_be_paced(speed, timestep, lag):
    p = pacer(speed=speed, timestep=timestep)
    due = p.due(100, 50.0 + lag)
    caught_up = min(lag, MAX_LAG + p.period)
    assert due - 100 == pytest.approx(caught_up / p.period, rel=0.02, abs=1.0)
    assert p.steps_per_wake >= 1
    assert p.deadline(due) <= 50.0 + lag + 1e-6 * p.period + 1e-6


def test_a_process_that_was_stopped_has_a_line_of_its_own_and_loses_no_more(caplog):
    p = pacer()
    assert p.due(100, 50.0 + 3600.0) == 151
    assert p.dropped == pytest.approx(3600.0 - 0.102)
    assert "no step was taken for 3599.9 s of wall time" in caplog.text
    assert "cannot keep up" not in caplog.text


def test_lag_that_is_dropped_again_and_again_has_one_line_for_each_span(caplog):
    p, now = pacer(), 50.0
    for _ in range(30):
        now += 1.0
        p.due(100, now)
    assert p.drops == 30
    assert len(caplog.messages) == 30 / REPORT_INTERVAL
