import itertools

import numpy as np
import pytest

from mjplug.physics import recovery as recovery_module
from mjplug.physics.divergence import Divergence
from mjplug.physics.recovery import MIN_STEPS_BETWEEN_RESETS, Recovery
from mjplug.physics.reset import Reset
from mjplug.physics.simulation import Simulation
from mjplug.testing import World

BAD = Divergence("acceleration", "rail", "cart", 0)


@pytest.fixture
def simulation(arm_model):
    return Simulation(arm_model)


def lines(caplog):
    found = [record.getMessage() for record in caplog.records if record.name == "mjplug.physics.recovery"]
    caplog.clear()
    return found


def test_of_a_thousand_divergences_a_second_the_log_gets_one_line_and_their_number(simulation, caplog):
    recovery = Recovery("reset")
    for k in range(3000):
        simulation.step = k * MIN_STEPS_BETWEEN_RESETS
        assert recovery.decide(BAD, simulation, 50.0 + k / 1000) == "reset"
    first, second, third = lines(caplog)
    assert "diverged in step 1 " in first
    assert "diverged in step 10001 " in second
    assert second.endswith(
        "the world is reset (sim.on_divergence: reset); it diverged 999 times more since the last line"
    )
    assert third.endswith("; it diverged 999 times more since the last line")
    assert recovery.count == 3000


def test_held_lines_are_reported_after_a_second_or_at_the_end(simulation, caplog):
    recovery = Recovery("pause")
    recovery.report_suppressed(0.5)
    recovery.decide(BAD, simulation, 1.0)
    recovery.decide(BAD, simulation, 1.5)
    lines(caplog)
    recovery.report_suppressed(1.9)
    assert lines(caplog) == []
    recovery.report_suppressed(2.0)
    assert lines(caplog) == [f"the simulation diverged once more (consequence: pause); latest: {recovery.last}"]
    recovery.decide(BAD, simulation, 2.1)
    recovery.report_suppressed(2.2, final=True)
    assert len(lines(caplog)) == 1
    recovery.report_suppressed(2.3, final=True)
    assert lines(caplog) == []
    # It was not the end.
    recovery.decide(BAD, simulation, 3.3)
    assert len(lines(caplog)) == 1


def test_a_pause_is_reported_at_once_however_many_resets_there_were(simulation, caplog):
    recovery = Recovery("reset")
    assert recovery.decide(BAD, simulation, 1.0) == "reset"
    simulation.step += MIN_STEPS_BETWEEN_RESETS - 1
    assert recovery.decide(BAD, simulation, 1.1) == "pause"
    assert "paused before that step (less than 10 steps after a reset)" in lines(caplog)[-1]


@pytest.mark.parametrize(("quantity", "hints"), [("velocity", 1), ("position", 1), ("acceleration", 0)])
def test_a_state_that_only_a_reset_repairs_is_pointed_out(simulation, caplog, quantity, hints):
    Recovery("pause").decide(Divergence(quantity, "rail", "cart", 0), simulation, 1.0)
    assert lines(caplog)[1:] == ["the state before that step is already invalid; reset the world"] * hints


def test_a_world_is_stuck_until_it_steps_or_is_reset(arm_model):
    world = World(arm_model)
    recovery, simulation = world.loop.recovery, world.simulation
    assert not recovery.before_diverged_step(simulation)
    for repair in (lambda: world.loop.reset(Reset()), lambda: world.loop.step(1)):
        world.data.qvel[0] = np.nan
        world.loop.step(1)
        assert recovery.before_diverged_step(simulation)
        world.data.qvel[0] = 0.0
        repair()
        assert not recovery.before_diverged_step(simulation)


def test_a_run_ends_with_what_was_held_back(arm_model, caplog, monkeypatch):
    # However long the run takes.
    monkeypatch.setattr(recovery_module, "REPORT_INTERVAL", 1000.0)
    world = World(arm_model, on_divergence="reset")
    bad = itertools.count()

    def poison():
        if next(bad) < 5:
            world.data.qvel[0] = np.nan

    world.host().create_timer(0.1, poison)
    world.loop.last_step = 400
    world.loop.run()
    assert world.simulation.epoch == 5
    first, last = lines(caplog)
    assert "the world is reset" in first
    assert last.startswith(
        "the simulation diverged 4 times more (consequence: reset); latest: the simulation diverged in step "
    )
