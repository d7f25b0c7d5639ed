"""Diagnostics on request, and the status `plugins`."""

import pytest

from mjplug.physics.loop import WALL_TIMER_PERIOD
from mjplug.plugin import Diagnosis, Parameters, Plugin
from mjplug.plugin.stopwatch import SAMPLES_PER_PERIOD
from mjplug.services import diagnostics
from mjplug.services.plugin_times import PluginTimes
from mjplug.testing import World
from mjplug_schemas.diagnostic_msgs import DiagnosticArray
from mjplug_schemas.std_msgs import Float64
from mjplug_schemas.std_srvs import Trigger


class WallClock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = WallClock()
    for module in (
        "mjplug.services.diagnostics",
        "mjplug.plugin.node_view",
        "mjplug.plugin.guard",
        "mjplug.plugin.stopwatch",
    ):
        monkeypatch.setattr(f"{module}.perf_counter", clock)
    return clock


@pytest.fixture
def world(arm_model, clock):
    world = World(arm_model)
    diagnostics.offer(world.host("sim"), world.loop, world.diagnostics, "/robot1/sim")
    return world


def second(world, clock):
    clock.now += WALL_TIMER_PERIOD
    for callback in world.loop.on_second:
        callback(clock.now)


def asked(world):
    response = world.call("/sim/get_diagnostics").response
    assert response.success
    return DiagnosticArray.from_json(response.message)


def test_a_request_returns_the_diagnostics_of_the_topic_immediately(world, clock):
    world.loop.step(5)
    answer = asked(world)
    assert [status.name for status in answer.status] == ["sim: simulation", "sim: inbox"]
    assert {status.hardware_id for status in answer.status} == {"/robot1/sim"}
    assert answer.header.stamp.to_ns() == 10_000_000
    second(world, clock)
    assert asked(world) == world.published("/diagnostics")[-1]
    assert world.transport.types["/sim/get_diagnostics"] is Trigger


def test_the_parts_are_not_asked_more_often_than_once_a_second_for_it(world, clock):
    calls = []
    world.host("camera").create_diagnostic("", lambda: calls.append(clock.now) or Diagnosis())
    for _ in range(5):
        asked(world)
        clock.now += WALL_TIMER_PERIOD / 10
    assert len(calls) == 1
    clock.now += WALL_TIMER_PERIOD
    asked(world)
    assert len(calls) == 2


class Busy(Plugin[Parameters]):
    clock: WallClock

    def init(self, host, parameters):
        self.host = host
        host.create_timer(0.02, lambda: self.take(2e-3))
        host.create_subscription(Float64, "~/number", lambda message: self.take(5e-3))
        host.create_service(Trigger, "~/ask", self.ask)

    def ask(self, request, call):
        self.take(10e-3)
        return Trigger.Response(success=True)

    def update(self):
        self.take(100e-6)

    def take(self, seconds):
        self.clock.now += seconds


@pytest.fixture
def busy(world, clock):
    times = PluginTimes(world.loop, clock.now)
    plugin = Busy()
    plugin.clock = clock
    host = world.host("busy", stopwatch=times.add("busy"))
    host.attach(plugin)
    plugin.init(host, Parameters())
    world.times, world.plugin = times, plugin
    return world


def figures(world, clock, seconds):
    clock.now += seconds
    world.times.refresh(clock.now)
    return world.times.diagnose().values


def test_timers_messages_and_requests_of_a_plugin_are_counted_with_their_time(busy, clock):
    began = clock.now
    busy.loop.step(100)
    busy.transport.send("/busy/number", Float64())
    busy.call("/busy/ask")
    # Ten timers, a message, a request.
    spent = 10 * 2e-3 + 5e-3 + 10e-3
    assert clock.now - began == pytest.approx(spent)
    values = figures(busy, clock, 1.0 - spent)
    assert values == {"busy (%)": pytest.approx(100 * spent), "busy calls (Hz)": pytest.approx(12.0)}
    assert busy.times.diagnose().message == "3.5 % of the time"
    assert figures(busy, clock, 1.0) == {}


def test_some_updates_are_measured_and_stand_for_all(busy, clock):
    busy.plugin.host.activate()
    busy.times.refresh(clock.now)
    began = clock.now
    busy.loop.step(5 * SAMPLES_PER_PERIOD)
    busy.plugin.host.deactivate()
    # The timer fired at every tenth step.
    spent = 5 * SAMPLES_PER_PERIOD * 100e-6 + SAMPLES_PER_PERIOD // 2 * 2e-3
    assert clock.now - began == pytest.approx(spent)
    values = figures(busy, clock, 1.0 - spent)
    assert values["busy update (us)"] == pytest.approx(100.0)
    assert values["busy (%)"] == pytest.approx(100 * spent)
    # Fewer than are measured stand for themselves only, however many steps there were.
    busy.plugin.host.activate()
    busy.loop.step(5)
    busy.plugin.host.deactivate()
    busy.loop.step(4)
    assert figures(busy, clock, 1.0 - 5 * 100e-6)["busy (%)"] == pytest.approx(5 * 100e-4)
    # What is not active has no updates.
    busy.loop.step(5)
    assert "busy update (us)" not in figures(busy, clock, 1.0)


def test_between_measurements_the_loop_calls_the_update_itself(busy, clock):
    busy.plugin.host.activate()
    busy.loop.step(5)
    (stepper,) = busy.loop.steppers.active
    assert stepper.update == busy.plugin.update
    busy.times.refresh(clock.now)
    assert stepper.update != busy.plugin.update
    busy.loop.step(SAMPLES_PER_PERIOD)
    assert stepper.update == busy.plugin.update


def test_an_update_that_fails_while_it_is_measured_is_that_failure(busy, clock):
    def broken():
        raise ZeroDivisionError

    plugin = Busy()
    plugin.update, plugin.clock = broken, clock
    host = busy.host("broken", stopwatch=busy.times.add("broken"), disable_on_error=True)
    host.attach(plugin)
    host.activate()
    busy.times.refresh(clock.now)
    busy.loop.step(3)
    assert not busy.loop.steppers.active
    assert busy.loop.failure is None
