"""Services through the bridge."""

import itertools
import json
import time

import pytest
from waits import until

from mjplug_schemas.rosgraph_msgs import Clock

pytestmark = pytest.mark.ros

SET_PAUSE = "mujoco_ros2_control_msgs/srv/SetPause"
APPLY_WRENCH = "mujoco_ros2_control_msgs/srv/ApplyExternalWrench"
TRIGGER = "std_srvs/srv/Trigger"


def wrenches(seconds, frame="base_link"):
    """The fields of a request."""
    push = {"header": {"frame_id": frame}, "wrench": {"force": {"x": 1.0}}}
    duration = {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}
    return {"wrenches": {"external_wrenches": [{"wrench": push, "duration": duration}]}}


def test_a_service_answers_with_its_type(ros, shared_bridge):
    response = ros.call("/mjplug/set_pause", SET_PAUSE, paused=False)
    assert (response.success, response.message) == (True, "the simulation is already running")
    state = ros.call("/probe/state", TRIGGER)
    assert state.success
    assert json.loads(state.message)["step"] >= 1


def test_a_refusal_of_the_server_arrives(ros, shared_bridge):
    response = ros.call("/external_wrench/apply_wrench", APPLY_WRENCH, **wrenches(1.0, frame="bse_link"))
    assert response.success is False
    assert "bse_link" in response.message
    assert "base_link" in response.message


def test_slow_calls_delay_neither_the_clock_nor_other_calls(ros, shared_bridge):
    clock = ros.subscribe("/clock", "rosgraph_msgs/msg/Clock", reliable=False)
    clock.next()
    began = time.monotonic()
    slow = [ros.send("/external_wrench/apply_wrench", APPLY_WRENCH, **wrenches(duration)) for duration in (2.0, 2.5)]
    quick = []
    for _ in range(10):
        sent = time.monotonic()
        assert ros.call("/probe/state", TRIGGER).success
        quick.append(time.monotonic() - sent)
    assert not any(answer.there for answer in slow)
    assert sorted(quick)[5] < 0.2
    responses = [answer.get() for answer in slow]
    assert [response.success for response in responses] == [True, True]
    assert time.monotonic() - began >= 2.4
    ticks = [Clock.from_cdr(payload).clock for payload in clock.drain()]
    seconds = [tick.sec + 1e-9 * tick.nanosec for tick in ticks]
    # 100 Hz of simulated time, of which a machine with other work may lose some.
    assert len(ticks) > 60
    assert max(later - earlier for earlier, later in itertools.pairwise(seconds)) < 1.0


def test_a_call_that_takes_too_long_fails_in_its_own_type(ros, serve, bridge):
    server = serve("--paused")
    own = bridge(server.endpoint, service_timeout=0.5)
    began = time.monotonic()
    response = ros.call("/own/external_wrench/apply_wrench", APPLY_WRENCH, **wrenches(1.0))
    assert (response.success, response.message) == (False, "the server did not answer within 0.5 s")
    assert time.monotonic() - began >= 0.5
    own.wait_for(r"ERROR.*/own/external_wrench/apply_wrench: the server did not answer within 0.5 s")
    assert ros.call("/own/mjplug/set_pause", SET_PAUSE, paused=True).success


def test_calls_that_wait_fail_when_the_server_dies(ros, serve, bridge):
    server = serve("--paused")
    own = bridge(server.endpoint)
    waiting = [ros.send("/own/external_wrench/apply_wrench", APPLY_WRENCH, **wrenches(1.0)) for _ in range(3)]
    assert ros.call("/own/probe/state", TRIGGER).success
    server.kill()
    for answer in waiting:
        response = answer.get()
        assert response.success is False
        assert response.message in (
            "/mjplug stopped or cannot be reached",
            "the server did not answer on external_wrench/apply_wrench",
        )
    own.wait_for("/mjplug stopped or cannot be reached; waiting for it")
    ready = ros.is_ready("/own/external_wrench/apply_wrench", APPLY_WRENCH)
    until(lambda: not ready())
