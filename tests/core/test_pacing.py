import pytest

from mjplug.core.pacing import LARGEST_LAG, Pacer
from mjplug.core.step_time import StepTime


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
    assert LARGEST_LAG == 0.1


def test_short_steps_are_not_woken_up_for_one_by_one():
    assert pacer(timestep=0.0001).steps_per_wake == 10
    assert pacer(timestep=0.002).steps_per_wake == 1
    assert pacer(timestep=0.0001, speed=10.0).steps_per_wake == 100
