"""`/diagnostics`, by a wall clock that the tests move."""

from collections import deque

import mujoco
import numpy as np
import pytest

from mjplug.contracts.transport import DEFAULT
from mjplug.contracts.work import WorkerStatus
from mjplug.physics import timing
from mjplug.physics.reset import Reset
from mjplug.plugin import Diagnosis, Level, worker_diagnosis
from mjplug.services import diagnostics, step_simulation
from mjplug.services.stepping.ownership import Ownership
from mjplug.testing import World
from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation
from mjplug_schemas.std_msgs import String


class WallClock:
    """Stands still but for waits, and a moment for each look at it."""

    def __init__(self):
        self.now = 1000.0
        self.moment = 1e-9

    def __call__(self):
        self.now += self.moment
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = WallClock()
    for module in ("mjplug.physics.loop", "mjplug.services.diagnostics"):
        monkeypatch.setattr(f"{module}.perf_counter", clock)
    return clock


@pytest.fixture
def serve(arm_model, clock):
    def serve(model=arm_model, **options):
        world = World(model, **options)

        def wait(seconds):
            clock.now += seconds

        world.loop.inbox.wait = wait
        diagnostics.offer(world.host("sim"), world.loop, world.diagnostics, "/robot1/sim")
        world.topic = world.transport.publishers["/diagnostics"]
        if not world.loop.paused:
            # Begins to count wall time, as `run` does.
            world.loop.resume()
        return world

    return serve


def run(world, clock, seconds):
    until = clock.now + seconds
    while clock.now < until:
        world.loop.turn()


def look(world, clock, seconds=1.0):
    """Lets wall time pass, with nothing else happening, and returns the statuses by their names."""
    clock.now += seconds
    for callback in world.loop.on_second:
        callback(clock.now)
    return {s.name.removeprefix("sim: "): s for message in world.topic.messages[-1:] for s in message.status}


def values(status):
    return {entry.key: entry.value for entry in status.values}


@pytest.mark.parametrize(
    "options", [{"paused": True}, {"speed": 1.0}, {"speed": 0.5}, {"speed": 1e-6}, {"speed": 20.0}]
)
def test_statuses_are_published_once_a_second_of_wall_time_paused_or_not_at_any_speed(serve, clock, options):
    world = serve(**options)
    run(world, clock, 9.5)
    assert len(world.topic.messages) == 10
    simulated = 0.0 if options.get("paused") else 9.0 * options["speed"]
    stamp = world.topic.messages[-1].header.stamp.to_ns() / 1e9
    assert stamp == pytest.approx(simulated, abs=0.003 + 0.001 * options.get("speed", 0.0))


def test_statuses_are_published_at_speed_max_and_during_a_long_step_request(serve, clock, monkeypatch):
    monkeypatch.setattr("mjplug.physics.loop._MAX_BATCH_STEPS", 1)
    clock.moment = 1e-3
    world = serve(speed="max")
    run(world, clock, 2.5)
    assert len(world.topic.messages) == 3
    step_simulation.offer(world.host("sim"), world.loop, Ownership("sim/@step"))
    world.loop.pause()
    world.call("/sim/step_simulation", StepSimulation.Request(steps=10**6))
    run(world, clock, 3.0)
    assert world.loop.goals
    assert len(world.topic.messages) == 6


def test_diagnostics_are_not_computed_without_subscribers(serve, clock):
    world = serve(paused=True)
    asked = []
    world.host("camera").create_diagnostic("", lambda: asked.append(clock.now) or Diagnosis())
    world.topic.matched = False
    run(world, clock, 5.0)
    assert (asked, world.topic.messages) == ([], [])
    world.topic.matched = True
    run(world, clock, 1.0)
    assert len(asked) == len(world.topic.messages) == 1


def test_the_time_without_subscribers_is_not_in_the_figures(serve, clock):
    world = serve()
    world.topic.matched = False
    look(world, clock, 100.0)
    world.topic.matched = True
    world.loop.step(250)
    assert values(look(world, clock)["simulation"])["step rate (Hz)"] == "250"


def test_a_status_is_as_ros_tools_expect_it(serve, clock):
    world = serve()
    world.host("camera").create_diagnostic("front", lambda: Diagnosis(Level.WARN, "slow", {"rate (Hz)": 1 / 3, "n": 7}))
    world.host("lidar").create_diagnostic(
        "", lambda: Diagnosis(values={"on": True, "name": "l", "rate": np.float32(2)})
    )
    world.loop.step(100)
    statuses = look(world, clock)
    assert list(statuses) == ["simulation", "inbox", "camera: front", "lidar"]
    front = statuses["camera: front"]
    assert (front.level, front.name, front.message) == (DiagnosticStatus.WARN, "sim: camera: front", "slow")
    assert front.hardware_id == "/robot1/sim"
    assert values(front) == {"rate (Hz)": "0.333333", "n": "7"}
    assert values(statuses["lidar"]) == {"on": "True", "name": "l", "rate": "2.0"}
    assert (statuses["lidar"].level, statuses["lidar"].message) == (DiagnosticStatus.OK, "ok")
    message = world.topic.messages[-1]
    assert (message.header.stamp.to_ns(), message.header.frame_id) == (200_000_000, "")
    assert DiagnosticArray.from_cdr(message.to_cdr()) == message
    assert (world.transport.types["/diagnostics"], world.transport.qos["/diagnostics"]) == (DiagnosticArray, DEFAULT)


def test_messages_that_newer_ones_replaced_are_counted_by_topic_without_a_warning(serve, clock):
    world = serve()
    host = world.host("robot")
    got = []
    host.create_subscription(String, "/cmd", lambda message: got.append(message.data))
    host.create_subscription(String, "/all", lambda message: got.append(message.data), DEFAULT)
    for word in "abcd":
        world.transport.send("/cmd", String(data=word))
        world.transport.send("/all", String(data=word.upper()))
    assert values(look(world, clock)["inbox"])["waiting"] == "8"
    world.loop.step(1)
    world.transport.send("/cmd", String(data="e"))
    world.loop.step(1)
    assert got == ["A", "B", "C", "d", "D", "e"]
    status = look(world, clock)["inbox"]
    assert values(status) == {"waiting": "0", "overruns": "0", "replaced": "3", "replaced on /cmd": "3"}
    assert status.level == DiagnosticStatus.OK


def test_the_simulation_reports_its_rates_over_the_last_second(serve, clock):
    world = serve(speed=2.0)
    look(world, clock)
    world.loop.step(800)
    status = look(world, clock, 2.0)["simulation"]
    assert (status.level, status.message) == (DiagnosticStatus.OK, "running at 0.8 x real time")
    figures = values(status)
    assert (figures["state"], figures["wanted speed"]) == ("running", "2")
    assert (figures["real-time factor"], figures["step rate (Hz)"], figures["steps"]) == ("0.8", "400", "800")
    assert figures["simulated time (s)"] == "1.600000"
    world.loop.pause()
    status = look(world, clock)["simulation"]
    assert (status.level, status.message) == (DiagnosticStatus.OK, "paused")
    assert values(status)["step rate (Hz)"] == "0"
    assert (values(status)["state"], values(status)["step time p99 (us)"]) == ("paused", "0")


def test_the_time_that_steps_take_is_reported(serve, clock):
    world = serve()
    look(world, clock)

    class Slow:
        def update(self):
            clock.now += 1e-3 if world.simulation.step != 5 else 20e-3

        def on_reset(self):
            pass

    slow = Slow()
    world.loop.steppers.add(slow)
    world.loop.steppers.activate(slow)
    for _ in range(200):
        world.loop.step(1)
    # 199 steps of 1 ms, one of 20 ms, and 0.781 s of nothing.
    figures = values(look(world, clock, 0.781)["simulation"])
    assert float(figures["load (%)"]) == pytest.approx(21.9, abs=0.01)
    assert float(figures["step time mean (us)"]) == pytest.approx(1095.0)
    assert float(figures["step time p50 (us)"]) == pytest.approx(1000.0)
    assert float(figures["step time p99 (us)"]) == pytest.approx(1000.0)
    world.loop.step(1)
    assert float(values(look(world, clock)["simulation"])["step time p99 (us)"]) == pytest.approx(1000.0)


def test_the_lateness_of_steps_is_reported(serve, clock):
    world = serve(speed=1.0)
    world.loop.turn()
    look(world, clock)
    world.loop.resume()
    for _ in range(100):
        clock.now = world.loop.pacer.deadline(world.simulation.step + 1) + 0.5e-3
        world.loop.turn()
    assert float(values(look(world, clock)["simulation"])["step lateness p99 (us)"]) == pytest.approx(500.0, rel=1e-5)


@pytest.mark.parametrize("count", [1, 2, 100, 101, 999])
def test_percentiles_are_those_of_numpy(count):
    percents = (50.0, 99.0, 0.0, 1.0, 100.0)
    numbers = deque(np.random.default_rng(count).random(count))
    assert timing.percentiles(numbers, *percents) == [*np.percentile(numbers, percents, method="inverted_cdf")]


def test_a_simulation_that_cannot_keep_up_warns_until_it_can(serve, clock):
    world = serve(speed=1.0)
    clock.now += 0.5
    world.loop.turn()
    status = look(world, clock, 0.5)["simulation"]
    assert (status.level, status.message.partition(":")[0]) == (DiagnosticStatus.WARN, "physics cannot keep up")
    assert values(status)["times fallen behind"] == "1"
    # What is caught up: 0.1 s and one step.
    assert float(values(status)["wall time lost (s)"]) == pytest.approx(0.5 - 0.1 - 0.002)
    status = look(world, clock)["simulation"]
    assert status.level == DiagnosticStatus.OK
    assert values(status)["times fallen behind"] == "1"


def poisoned(serve, policy):
    world = serve(on_divergence=policy)
    world.loop.step(20)
    world.data.qvel[0] = np.inf
    world.loop.step(5)
    return world


def test_a_simulation_that_diverged_is_an_error_until_it_is_reset(serve, clock):
    world = poisoned(serve, "pause")
    for _ in range(2):
        status = look(world, clock)["simulation"]
        assert status.level == DiagnosticStatus.ERROR
        assert status.message.startswith(
            "the simulation diverged in step 21 (t = 0.040000 s): velocity of joint shoulder"
        )
        assert values(status)["last divergence"] == status.message
    world.loop.reset(Reset())
    status = look(world, clock)["simulation"]
    assert (status.level, status.message) == (DiagnosticStatus.OK, "paused")
    assert (values(status)["resets"], values(status)["divergences"]) == ("1", "1")


def test_a_simulation_that_diverged_and_was_repaired_is_well_once_it_has_stepped(serve, clock):
    world = poisoned(serve, "pause")
    world.data.qvel[0] = 0.0
    assert look(world, clock)["simulation"].level == DiagnosticStatus.ERROR
    world.loop.step(1)
    assert look(world, clock)["simulation"].level == DiagnosticStatus.OK


def test_a_simulation_that_diverged_and_was_reset_warns_once(serve, clock):
    world = poisoned(serve, "reset")
    status = look(world, clock)["simulation"]
    assert status.level == DiagnosticStatus.WARN
    assert status.message.endswith("is NaN, infinite or above 1e10; 1 in the last second")
    assert look(world, clock)["simulation"].level == DiagnosticStatus.OK


def test_requests_that_wait_are_counted(serve, clock):
    world = serve(paused=True)
    step_simulation.offer(world.host("sim"), world.loop, Ownership("sim/@step"))
    assert values(look(world, clock)["simulation"])["waiting requests"] == "0"
    for _ in range(3):
        world.transport.call("/sim/step_simulation", StepSimulation.Request(steps=10**9))
    world.loop.turn()
    assert values(look(world, clock)["simulation"])["waiting requests"] == "3"


class Unspeakable:
    def __str__(self):
        raise OSError("no words")


@pytest.mark.parametrize(
    ("task", "sentence"),
    [
        (lambda: 1 / 0, "its diagnostic task failed: ZeroDivisionError('division by zero')"),
        (lambda: None, "its diagnostic task failed: TypeError('a diagnostic task must return a Diagnosis, not None')"),
        (lambda: Diagnosis(7), "its diagnostic task failed: ValueError('7 is not a valid Level')"),
        (lambda: Diagnosis(values={"x": Unspeakable()}), "its diagnostic task failed: OSError('no words')"),
    ],
    ids=["raises", "says nothing", "has another level", "has no words"],
)
def test_a_task_that_fails_is_an_error_itself_logged_once_and_does_not_affect_others(
    serve, clock, caplog, task, sentence
):
    world = serve()
    world.host("camera").create_diagnostic("front", task)
    world.host("lidar").create_diagnostic("", Diagnosis)
    for _ in range(3):
        statuses = look(world, clock)
        assert list(statuses) == ["simulation", "inbox", "camera: front", "lidar"]
        assert (statuses["camera: front"].level, statuses["camera: front"].message) == (
            DiagnosticStatus.ERROR,
            sentence,
        )
        assert statuses["lidar"].level == DiagnosticStatus.OK
    assert [record.getMessage() for record in caplog.records] == ["the diagnostic task of camera: front failed"]
    assert caplog.records[0].exc_info


def test_what_is_no_ros_string_is_made_one(serve, clock):
    world = serve()
    world.host("camera").create_diagnostic("", lambda: Diagnosis(Level.OK, "a\0b", {"file\0": "\udcff.xml"}))
    camera = look(world, clock)["camera"]
    assert (camera.message, values(camera)) == (
        "a\N{REPLACEMENT CHARACTER}b",
        {"file\N{REPLACEMENT CHARACTER}": "?.xml"},
    )


def test_a_plugin_that_was_switched_off_is_an_error(serve, clock):
    world = serve()
    host = world.host("broken", disable_on_error=True)
    host.create_diagnostic("", Diagnosis)
    host.create_timer(0.002, lambda: 1 / 0)
    assert look(world, clock)["broken"].level == DiagnosticStatus.OK
    world.loop.step(1)
    broken = look(world, clock)["broken"]
    assert (broken.level, broken.message) == (
        DiagnosticStatus.ERROR,
        "plugin broken was disabled after an error: ZeroDivisionError('division by zero')",
    )


@pytest.mark.parametrize(
    ("health", "level", "message"),
    [
        (WorkerStatus(), Level.OK, "starting"),
        (WorkerStatus("running", performed=3), Level.OK, "running"),
        (WorkerStatus("restarting", "it was killed", restarts=1), Level.WARN, "restarting: it was killed"),
        (WorkerStatus("unavailable", "no GL"), Level.ERROR, "unavailable: no GL"),
    ],
    ids=lambda value: value.state if isinstance(value, WorkerStatus) else "",
)
def test_a_worker_has_a_status(health, level, message):
    said = worker_diagnosis(health)
    assert (said.level, said.message) == (level, message)
    assert (said.values["state"], said.values["jobs performed"]) == (health.state, health.performed)


def test_a_worker_reports_what_it_dropped_for_each_task(serve, clock):
    world = serve()
    health = WorkerStatus("running", performed=9, dropped={"rear": 2, "front": 1}, restarts=4)
    world.host("camera").create_diagnostic("worker", lambda: worker_diagnosis(health))
    assert values(look(world, clock)["camera: worker"]) == {
        "state": "running",
        "jobs performed": "9",
        "states dropped": "3",
        "restarts": "4",
        "waiting for a processor (%)": "0",
        "states dropped for front": "1",
        "states dropped for rear": "2",
    }


def test_a_model_without_anything_has_a_status_too(serve, clock):
    world = serve(mujoco.MjModel.from_xml_string("<mujoco/>"))
    world.loop.step(3)
    assert values(look(world, clock)["simulation"])["steps"] == "3"


def test_contacts_are_counted(serve, clock):
    """Three spheres, of which two lie on the ground and touch each other."""
    spheres = "".join(
        f"<body pos='{x} 0 {z}'><freejoint/><geom size='.1'/></body>"
        for x, z in ((0.0, 0.09), (0.19, 0.09), (3.0, 2.0))
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option gravity='0 0 0'/><worldbody><geom type='plane' size='5 5 .1'/>{spheres}</worldbody></mujoco>"
    )
    world = serve(model, paused=True)
    world.loop.step(1)
    look(world, clock)
    assert values(look(world, clock)["simulation"])["contacts"] == "3"
