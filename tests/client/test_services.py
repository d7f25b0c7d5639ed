"""Services, called through a live server."""

import threading
import time
from dataclasses import replace

import pytest
from cli.process import Served
from waits import TIMEOUT

from mjplug.client import RequestRefused, TimedOutError, UnknownNameError, WrongTypeError, connect, request
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import (
    ApplyExternalWrench,
    ExternalWrench,
    ExternalWrenchArray,
    SetPause,
    StepSimulation,
)
from mjplug_schemas.rcl_interfaces import Parameter, ParameterValue
from mjplug_schemas.std_msgs import Header


def push(*seconds, force=1.0):
    wrenches = tuple(
        ExternalWrench(
            wrench=WrenchStamped(header=Header(frame_id="box"), wrench=Wrench(force=Vector3(x=force))),
            duration=Duration(sec=int(each), nanosec=round((each % 1) * 1e9)),
        )
        for each in seconds
    )
    return ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=wrenches))


def test_a_service_is_called_with_fields_a_message_or_a_dictionary(client):
    paused = SetPause.Response(success=True, message="the simulation is now paused")
    already = SetPause.Response(success=True, message="the simulation is already paused")
    assert client.call("~/set_pause", paused=True) == paused
    assert client.call("/mjplug/set_pause", SetPause.Request(paused=True)) == already
    assert client.call("mjplug/set_pause", {"paused": True}) == already
    assert client.call("~/step_simulation", steps=5).message.startswith("took 5 steps")


def test_a_request_that_is_refused_raises_with_the_reason_and_the_response(client):
    with pytest.raises(RequestRefused, match=r"^/mjplug/step_simulation refused: the simulation is running") as refused:
        client.call("~/step_simulation", steps=1)
    assert refused.value.reason.endswith("pause it first (~/set_pause, or mjplug sim pause)")
    assert refused.value.response == StepSimulation.Response(success=False, message=refused.value.reason)
    assert client.call("~/step_simulation", check=False, steps=1) == refused.value.response


def test_an_error_reply_raises_with_its_sentence(client):
    vague = replace(client.service("~/set_pause"), key="*/set_pause")
    with pytest.raises(RequestRefused, match=r"set_pause is a service; query exactly this key") as refused:
        request.send(client.session, vague, SetPause.Request(), SetPause, TIMEOUT)
    assert refused.value.response is None


@pytest.mark.parametrize(
    ("name", "fields", "error", "sentence"),
    [
        ("~/set_puse", {}, UnknownNameError, r"unknown service '/mjplug/set_puse', did you mean '/mjplug/set_pause'"),
        ("~/set_pause", {"pausd": True}, WrongTypeError, r"unknown field 'pausd', did you mean 'paused'\?"),
        ("~/set_pause", {"paused": 1}, WrongTypeError, r"paused must be a bool \(true or false\), got 1"),
        ("~/step_simulation", {"steps": -1}, WrongTypeError, r"steps must be a uint32"),
    ],
)
def test_a_wrong_request_does_not_leave(client, name, fields, error, sentence):
    with pytest.raises(error, match=sentence):
        client.call(name, **fields)
    with pytest.raises(WrongTypeError, match=r"the request is given twice: as a message, and as paused"):
        client.call("~/set_pause", {"paused": True}, paused=False)
    with pytest.raises(WrongTypeError, match=r"expected .*SetPause_Request, not .*StepSimulation_Request"):
        client.call("~/set_pause", StepSimulation.Request())


def test_the_default_timeout_follows_from_the_request_and_the_speed():
    assert request.default_timeout(push(2.0, 7.5), speed=0.5) == pytest.approx(request.MARGIN + 15.0)
    assert request.default_timeout(push(), speed=1.0) == request.MARGIN
    assert request.default_timeout(SetPause.Request(), speed=0.1) == request.MARGIN
    assert request.default_timeout(StepSimulation.Request(steps=1_000_000), speed=0.1) == request.MARGIN + 1000.0


def test_a_wrench_is_waited_for_as_long_as_it_takes_at_the_speed_of_the_server(client, monkeypatch):
    monkeypatch.setattr(request, "MARGIN", 1.0)
    waited = []
    original = request.send

    def send(session, service, sent, kind, timeout, parameters=""):
        waited.append(timeout)
        return original(session, service, sent, kind, timeout)

    monkeypatch.setattr(request, "send", send)
    half = Parameter(name="sim.speed", value=ParameterValue(type=3, double_value=0.5))
    full = Parameter(name="sim.speed", value=ParameterValue(type=3, double_value=1.0))
    assert client.call("~/set_parameters", parameters=[half]).results[0].successful
    try:
        began = time.monotonic()
        answer = client.call("/external_wrench/apply_wrench", push(0.4))
        assert 0.75 < time.monotonic() - began < TIMEOUT
        assert answer.message == "applied 1 wrench, the longest for 0.4 s"
        assert waited[1:] == [pytest.approx(1.0 + 0.8)]
    finally:
        client.call("~/set_parameters", parameters=[full])


def test_an_answer_that_does_not_come_ends_in_time_and_says_that_the_simulation_is_paused(client):
    client.call("~/set_pause", paused=True)
    began = time.monotonic()
    with pytest.raises(
        TimedOutError, match=r"^no answer from .*/apply_wrench within 0\.3 s; the simulation is paused$"
    ):
        client.call("/external_wrench/apply_wrench", push(0.1), timeout=0.3)
    assert 0.3 <= time.monotonic() - began < TIMEOUT
    assert client.call("~/reset_world").success


def test_calls_from_several_threads_get_their_own_answers(client):
    answers = {}

    def call(steps):
        answers[steps] = client.call("~/step_simulation", steps=steps).message

    client.call("~/set_pause", paused=True)
    threads = [threading.Thread(target=call, args=(steps,)) for steps in (3, 5, 7)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(TIMEOUT)
    assert {steps: message.partition(";")[0] for steps, message in answers.items()} == {
        steps: f"took {steps} steps" for steps in (3, 5, 7)
    }


def test_a_server_that_stops_meanwhile_reports_it(tmp_path):
    server = Served("bundled:box", "--paused", cwd=tmp_path)
    with connect(server.endpoint) as client:
        reasons = []

        def step_for_ever():
            try:
                client.call("~/step_simulation", steps=2**32 - 1)
            except RequestRefused as error:
                reasons.append(error.reason)

        waiting = threading.Thread(target=step_for_ever)
        with client.subscribe("/clock", dict) as clock:
            waiting.start()
            while clock.next(TIMEOUT)["clock"] == {"sec": 0, "nanosec": 0}:
                pass
        assert server.stop() == 0
        waiting.join(TIMEOUT)
        (reason,) = reasons
        assert reason.startswith("cancelled: the server is stopping")
        assert client.nodes() == []
