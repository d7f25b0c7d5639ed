"""When cameras publish: at their rates, on request, with subscribers, and while the worker process is busy or dead."""

import logging
from time import perf_counter

import numpy as np
import pytest
from camera_scenes import (
    FLOOR,
    closing,  # noqa: F401 - a fixture
    gl,  # noqa: F401 - a fixture
    pixels,
    scene,
    world_of,
)

from mjplug.contracts.diagnostics import Level
from mjplug.physics.reset import Reset
from mjplug_plugins.camera import Camera
from mjplug_plugins.camera.gl import BACKEND_VARIABLE

TWO = '<camera name="front" pos="0 0 2" resolution="16 12"/><camera name="wrist" pos="0 0 3" resolution="20 30"/>'
MOVING = '<body pos="0 0 .1"><freejoint/><geom type="box" size="2 2 .1"/></body>'
POLLED = {"policy": "polled"}


def stamps(world, topic, instance="cameras"):
    return [message.header.stamp.to_ns() / 1e9 for message in world.published(f"/{instance}/{topic}")]


def listen(world, *topics):
    """Lets only these topics have listeners."""
    for name, publisher in world.transport.publishers.items():
        publisher.matched = name.removeprefix("/cameras/") in topics


def worker(world):
    return world.workers.workers["cameras"]


def diagnosis(world):
    return world.diagnostics.diagnose()["cameras"]


def test_1_hz_and_60_hz_go_together():
    world = world_of(scene(TWO), camera_publish_rate=60.0, front={"publish_rate": 1.0})
    world.loop.step(1000)
    assert stamps(world, "front/color") == [1.0, 2.0]
    wrist = stamps(world, "wrist/color")
    assert len(wrist) == 120
    assert wrist[59] == 1.0
    assert np.ptp(np.diff(wrist)) == pytest.approx(0.002, abs=1e-9)


def test_cameras_of_different_sizes_share_the_state_of_one_instant():
    """Both see the top of a box that comes nearer; at their common instants it is the same box."""
    world = world_of(scene(TWO, MOVING), camera_publish_rate=4.0, wrist={"publish_rate": 10.0})
    world.data.qvel[2] = 0.5
    world.loop.step(1000)
    front, wrist = (
        {m.header.stamp.to_ns(): pixels(m) for m in world.published(f"/cameras/{name}/depth")}
        for name in ("front", "wrist")
    )
    common = front.keys() & wrist.keys()
    assert sorted(common) == [500_000_000, 1_000_000_000, 1_500_000_000, 2_000_000_000]
    for stamp in common:
        assert front[stamp].shape == (12, 16)
        assert wrist[stamp].shape == (30, 20)
        top = 0.2 + 0.5 * stamp / 1e9
        assert front[stamp][6, 8] == pytest.approx(2.0 - top, rel=1e-5)
        assert wrist[stamp][15, 10] == pytest.approx(3.0 - top, rel=1e-5)
    # Together means in one job.
    assert worker(world).status.performed == len(front.keys() | wrist.keys())


def test_only_topics_with_subscribers_are_published():
    world = world_of(scene(TWO))
    listen(world, "front/depth", "wrist/camera_info")
    world.loop.step(100)
    published = {name for name, publisher in world.transport.publishers.items() if publisher.messages}
    assert published == {"/cameras/front/depth", "/cameras/wrist/camera_info"}


def test_cameras_sleep_until_a_topic_has_a_subscriber():
    world = world_of(scene(TWO))
    listen(world)
    world.loop.step(250)
    assert worker(world).status.performed == 0
    assert world.loop.scheduler.next_due > world.simulation.step + 10_000
    listen(world, "wrist/depth/compressedDepth")
    world.transport.publishers["/cameras/wrist/depth/compressedDepth"].on_matched()
    world.loop.step(250)
    assert stamps(world, "wrist/depth/compressedDepth") == [0.6, 0.8, 1.0]


def test_a_camera_publishes_if_a_camera_of_another_rate_has_no_subscriber():
    world = world_of(scene(TWO), camera_publish_rate=5.0, wrist={"publish_rate": 10.0})
    listen(world, "front/color")
    world.loop.step(200)
    assert stamps(world, "front/color") == [0.2, 0.4]
    listen(world, "wrist/color")
    world.transport.publishers["/cameras/wrist/color"].on_matched()
    world.loop.step(100)
    assert stamps(world, "wrist/color") == [0.5, 0.6]
    assert stamps(world, "front/color") == [0.2, 0.4]


def test_a_disabled_camera_has_no_topics_and_a_polled_one_no_rate():
    world = world_of(scene(TWO), front={"policy": "disabled"}, wrist=POLLED)
    assert set(world.transport.publishers) == {
        f"/cameras/wrist/{topic}"
        for topic in ("color", "depth", "camera_info", "color/compressed", "depth/compressedDepth")
    }
    assert world.transport.services == {"/cameras/wrist/trigger"}
    world.loop.step(1000)
    assert stamps(world, "wrist/color") == []


def test_a_trigger_answers_when_the_image_has_been_published():
    world = world_of(scene(TWO), front=POLLED, wrist=POLLED)
    world.loop.step(617)
    worker(world).hold()
    call = world.call("/cameras/front/trigger")
    world.loop.step(40)
    assert not call.answered
    assert stamps(world, "front/color") == []
    worker(world).release()
    world.loop.step(1)
    assert call.response.success
    everything = "camera_info, color, compressed, compressedDepth, depth"
    assert call.response.message == f"published {everything}; stamp 1.234000000"
    assert stamps(world, "front/color") == stamps(world, "front/depth") == stamps(world, "front/camera_info") == [1.234]
    assert stamps(world, "wrist/color") == []


def test_a_trigger_works_while_paused():
    world = world_of(scene(TWO, MOVING), front=POLLED)
    world.loop.pause()
    world.loop.inbox.post(lambda: world.data.qpos.__setitem__(2, 0.6))
    listen(world, "front/depth")
    call = world.transport.call("/cameras/front/trigger")
    while not call.answered:
        world.loop.turn()
    assert world.simulation.step == 0
    assert call.response.message == "published depth; stamp 0.000000000"
    assert pixels(world.published("/cameras/front/depth")[0])[6, 8] == pytest.approx(2.0 - 0.7, rel=1e-5)


def test_triggers_at_a_time_are_all_answered():
    world = world_of(scene(TWO), front=POLLED, wrist=POLLED)
    worker(world).hold()
    calls = [world.call(f"/cameras/{name}/trigger") for name in ("front", "wrist", "front", "front")]
    worker(world).release()
    world.loop.step(1)
    assert [call.response.success for call in calls] == [True] * 4
    assert [call.answers for call in calls] == [1] * 4
    # One image serves all that waited for it.
    assert len(stamps(world, "front/color")) == len(stamps(world, "wrist/color")) == 1
    assert worker(world).status.dropped == {}


def test_a_trigger_draws_even_without_subscribers_and_reports_it():
    world = world_of(scene(TWO), front=POLLED)
    listen(world)
    call = world.call("/cameras/front/trigger")
    world.loop.step(1)
    assert call.response.success
    assert call.response.message == "rendered, but no topic has subscribers; stamp 0.000000000"


def test_a_reset_refuses_waiting_triggers_and_restarts_the_rates():
    world = world_of(scene(TWO, MOVING), front=POLLED, wrist={"publish_rate": 10.0})
    world.loop.step(70)
    worker(world).hold()
    call = world.call("/cameras/front/trigger")
    world.loop.reset(Reset())
    assert call.refusal == "cancelled: the world was reset"
    worker(world).release()
    world.loop.step(100)
    assert call.answers == 1
    # The job of before the reset is still published, with its own stamp; then periods count from the reset on.
    assert stamps(world, "wrist/color") == [0.1, 0.24, 0.34]
    assert stamps(world, "front/color") == [0.14]
    later = world.call("/cameras/front/trigger")
    world.loop.step(1)
    assert later.response.success


def test_a_lost_process_refuses_the_triggers_it_had():
    world = world_of(scene(TWO), front=POLLED)
    worker(world).hold()
    call = world.call("/cameras/front/trigger")
    spec = worker(world).spec
    (task,) = worker(world)._waiting[0].tasks
    world.loop.inbox.post(lambda: spec.on_lost(frozenset([task]), "the process was killed by SIGKILL"))
    world.loop.step(1)
    assert call.refusal == "the process was killed by SIGKILL"


def test_a_busy_process_gets_the_newest_state_and_what_it_misses_is_counted(caplog):
    world = world_of(scene(TWO), camera_publish_rate=10.0, wrist={"publish_rate": 5.0})
    worker(world).hold()
    world.loop.step(200)
    worker(world).release()
    world.loop.step(1)
    assert stamps(world, "front/color") == [0.4]
    assert stamps(world, "wrist/color") == [0.4]
    said = diagnosis(world)
    assert said.level == Level.WARN
    assert said.message == "rendering is slower than requested; 4 images were dropped since the last status"
    assert [said.values[f"states dropped for stream {name}"] for name in ("front", "wrist")] == ["3", "1"]
    assert diagnosis(world).level == Level.OK


def test_diagnostics_report_the_renderer_and_the_image_rate():
    world = world_of(scene(TWO), camera_publish_rate=50.0)
    world.loop.step(500)
    second(world)
    said = diagnosis(world)
    assert said.level == Level.OK
    assert said.values["renderer"].startswith("rendering with ")
    assert said.values["state"] == "running"
    assert float(said.values["images/s of front"]) > 0
    assert said.values["images/s of front"] == said.values["images/s requested of front"]


def second(world):
    """Does what the loop does once a second of wall time."""
    world.loop.step(0)
    for callback in world.loop.on_second:
        callback(perf_counter())


@pytest.fixture
def clock(monkeypatch):
    """Wall time as the plugin sees it [s]; a list of one."""
    now = [0.0]
    for module in ("mjplug_plugins.rate_monitor", "mjplug_plugins.camera.triggers"):
        monkeypatch.setattr(f"{module}.monotonic", lambda: now[0])
    return now


def seconds(world, clock, count, each=lambda: None):
    """Lets wall time go by."""
    for _ in range(count):
        each()
        clock[0] += 1.0
        world.loop.step(0)
        for callback in world.loop.on_second:
            callback(clock[0])


def warnings(caplog):
    """Returns the warnings, without the warning about the renderer of this machine."""
    told = [r.getMessage() for r in caplog.records if r.name.endswith("cameras") and r.levelno >= logging.WARNING]
    return [text for text in told if not text.startswith("rendering with ")]


def test_a_camera_that_reaches_less_than_half_of_its_rate_is_reported_once_a_minute(clock, caplog):
    world = world_of(scene(TWO), camera_publish_rate=10.0, wrist={"publish_rate": 2.0})
    health = worker(world).status
    health.starved = 0.9

    def one_second():
        # One image of front a second instead of ten, one of wrist instead of two.
        worker(world).hold()
        world.loop.step(500)
        worker(world).release()

    caplog.clear()
    seconds(world, clock, 70, one_second)
    slow = (
        "front reaches 1.0 of 10.0 images/s: the worker process waits for a processor 90% of its time, because other "
        "programs keep the processors busy; see the parameter `priority`"
    )
    assert warnings(caplog) == [slow, slow]
    said = diagnosis(world)
    assert (said.level, said.message) == (Level.WARN, slow)
    assert said.values["images/s of front"] == "1"
    assert said.values["images/s requested of front"] == "10"


def test_drops_are_counted_by_topic(clock):
    world = world_of(scene(TWO), camera_publish_rate=10.0)
    listen(world, "front/color", "front/camera_info")
    worker(world).hold()
    world.loop.step(250)
    worker(world).release()
    seconds(world, clock, 1)
    dropped = {name: count for name, count in diagnosis(world).values.items() if name.startswith("dropped on ")}
    assert dropped == {"dropped on /cameras/front/color": "4", "dropped on /cameras/front/camera_info": "4"}


def test_a_camera_that_keeps_up_is_not_reported(clock, caplog):
    world = world_of(scene(TWO), camera_publish_rate=10.0, wrist={"publish_rate": 0.5})
    caplog.clear()
    seconds(world, clock, 30, lambda: world.loop.step(500))
    assert warnings(caplog) == []
    assert diagnosis(world).level == Level.OK


@pytest.mark.parametrize(
    ("state", "reason", "why"),
    [
        ("starting", "", "the worker process is still starting"),
        ("restarting", "it died", "the worker process is being restarted: it died"),
        ("running", "", "the worker process is busy; reduce sizes, rates or quality"),
    ],
)
def test_a_trigger_that_takes_too_long_is_refused_with_the_reason(clock, state, reason, why):
    world = world_of(scene(TWO), front=POLLED, trigger_timeout=3.0)
    world.loop.step(1)
    worker(world).hold()
    call = world.call("/cameras/front/trigger")
    worker(world).status.state, worker(world).status.reason = state, reason
    seconds(world, clock, 2)
    assert not call.answered
    seconds(world, clock, 4)
    assert call.refusal == f"no image within 3 s (trigger_timeout): {why}"
    # The image that comes later answers no request.
    worker(world).release()
    world.loop.step(1)
    assert call.answers == 1


def test_the_settings_of_the_process_are_those_of_the_configuration():
    spec = worker(world_of(scene(TWO))).spec
    assert (spec.priority, spec.job_timeout) == ("low", 60.0)
    spec = worker(world_of(scene(TWO), priority="idle", job_timeout=5.0)).spec
    assert (spec.priority, spec.job_timeout) == ("idle", 5.0)


def test_in_software_the_log_reports_it_once(caplog):
    world = world_of(scene(TWO))
    world.loop.step(1)
    spec = worker(world).spec
    world.loop.inbox.post(lambda: spec.on_ready("rendering with EGL on llvmpipe (in software)"))
    world.loop.step(1)
    assert len([r for r in caplog.records if "rendering with" in r.getMessage()]) == 1


def without_gl(monkeypatch, backend="egl"):
    """Makes OpenGL fail as it does where its library is missing."""
    monkeypatch.setenv(BACKEND_VARIABLE, backend)
    monkeypatch.setattr(
        f"mujoco.{backend}.GLContext", lambda *size: (_ for _ in ()).throw(AttributeError("no eglQueryString"))
    )


def test_without_opengl_the_server_lives_and_triggers_say_what_to_install(monkeypatch, caplog, gl):  # noqa: F811
    without_gl(monkeypatch, gl)
    world = world_of(scene(TWO), front=POLLED)
    world.loop.step(500)
    # The worker pool has already logged it.
    assert [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING] == []
    call = world.call("/cameras/front/trigger")
    assert call.refusal.startswith("cameras are unavailable: no OpenGL through ")
    assert "AttributeError: no eglQueryString" in call.refusal
    assert stamps(world, "wrist/color") == []
    assert diagnosis(world).level == Level.ERROR


def test_a_trigger_that_waits_while_opengl_turns_out_to_be_missing_is_refused(monkeypatch, gl):  # noqa: F811
    without_gl(monkeypatch, gl)
    world = world_of(scene(TWO), front=POLLED)
    call = world.transport.call("/cameras/front/trigger")
    world.loop.step(1)
    assert call.refusal


def test_a_lost_context_fails_loudly():
    """Without a context OpenGL's functions do nothing at all, and would leave the last image in place."""
    world = world_of(scene(TWO, FLOOR))
    world.loop.step(100)
    work = worker(world).work
    lost = work._renderer.gl
    lost._context.free()
    lost.make_current = lambda: None
    world.loop.step(100)
    assert "OpenGL renders nothing: its context was lost" in str(world.loop.failure)
    assert len(stamps(world, "front/color")) == 1


def test_a_model_without_cameras_is_said_and_harmless(caplog):
    world = world_of(scene(""))
    world.loop.step(1000)
    world.loop.reset(Reset())
    assert world.transport.publishers == {}
    assert world.workers.workers == {}
    assert [r.getMessage() for r in caplog.records] == ["the model has no camera: nothing is published"]


def test_with_every_camera_disabled_no_process_is_started(caplog):
    world = world_of(scene(TWO), front={"policy": "disabled"}, wrist={"policy": "disabled"})
    assert world.workers.workers == {}
    assert [r.getMessage() for r in caplog.records] == ["every camera is disabled: nothing is published"]


def test_sync_is_asked_for_when_it_is_configured():
    assert not worker(world_of(scene(TWO))).spec.sync
    assert worker(world_of(scene(TWO), sync=True)).spec.sync


def test_two_instances_draw_on_their_own():
    world = world_of(scene(TWO), front={"policy": "disabled"})
    world.add(Camera, "others", wrist={"policy": "disabled"})
    world.loop.step(100)
    assert len(stamps(world, "wrist/color")) == len(stamps(world, "front/color", "others")) == 1
