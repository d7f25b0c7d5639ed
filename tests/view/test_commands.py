"""Service calls, messages and drags of pages."""

import json
import threading
import time

import pytest
from waits import until

from mjplug.view import commands
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause
from mjplug_schemas.rcl_interfaces import ListParameters

PAUSE = "mujoco_ros2_control_msgs/srv/SetPause"


@pytest.fixture
def requests():
    return []


@pytest.fixture
def commanded(new_server, requests):
    waiting = threading.Event()

    def pause(query):
        request = SetPause.Request.from_cdr(bytes(query.payload))
        requests.append(request.paused)
        return bytes(SetPause.Response(success=True, message="done").to_cdr())

    def refuse(query):
        raise ValueError("the simulation is busy")

    def own(query):
        return json.dumps({"got": json.loads(bytes(query.payload))}).encode()

    server = new_server(
        subscribed={"/cmd_vel": "geometry_msgs/msg/Twist", "/lamp": "own_msgs/msg/Lamp"},
        services={
            "/mjplug/set_pause": (PAUSE, pause),
            "/mjplug/refusing": (PAUSE, refuse),
            "/mjplug/silent": (PAUSE, lambda query: waiting.wait(0.0) or None),
            "/mjplug/list_parameters": (
                "rcl_interfaces/srv/ListParameters", lambda query: bytes(ListParameters.Response().to_cdr()),
            ),
            "/mjplug/switch": ("own_msgs/srv/Switch", own),
        },
    )  # fmt: skip
    yield server
    waiting.set()


@pytest.fixture
def new_ready_page(commanded, new_relay, new_page):
    def start(**options):
        page = new_page(new_relay(**options))
        if not page.hello["servers"]:
            page.text("servers")
        return page

    return start


@pytest.fixture
def ready(new_ready_page):
    return new_ready_page()


def test_a_service_is_called_and_its_response_is_json(ready, requests):
    response = ready.do(op="call", service="/mjplug/set_pause", request={"paused": True})
    assert response == {"success": True, "message": "done"}
    assert ready.do(op="call", service="~/set_pause", server=0)["success"] is True
    assert requests == [True, False]


def test_a_service_whose_type_only_the_server_knows_gets_json(ready):
    assert ready.do(op="call", service="/mjplug/switch", request={"on": 1}) == {"got": {"on": 1}}


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ({"service": "/mjplug/set_puase"}, "unknown service '/mjplug/set_puase', did you mean '/mjplug/set_pause'?"),
        ({"service": "/mjplug/set_pause", "request": {"pause": True}}, "unknown field 'pause'"),
        ({"service": "/mjplug/set_pause", "request": [1]}, "expected mujoco_ros2_control_msgs/srv/SetPause_Request"),
        ({"service": "/mjplug/refusing"}, "/mjplug/refusing refused: the simulation is busy"),
        ({"service": "/mjplug/silent"}, "mjplug/silent did not answer; its server may have stopped"),
        ({"service": None}, "the name is null; it must be a string"),
        ({"service": "~/set_pause", "server": 3}, "server is 3; there are: 0 (/mjplug)"),
    ],
)
def test_a_call_that_fails_has_a_reason(ready, request_, reason):
    assert ready.refused(op="call", **request_).startswith(reason) or reason in ready.refused(op="call", **request_)


def test_a_message_is_published_as_the_type_of_the_topic(ready, commanded):
    ready.do(op="publish", topic="/cmd_vel", message={"linear": {"x": 0.5}})
    ready.do(op="publish", topic="/cmd_vel", type="geometry_msgs/msg/Twist", message={})
    ready.do(op="publish", topic="/lamp", message={"on": True})
    wanted = [bytes(Twist(linear=Vector3(x=0.5)).to_cdr()), bytes(Twist().to_cdr())]
    assert commanded.wait_for("cmd_vel", 2) == wanted
    assert [json.loads(each) for each in commanded.wait_for("lamp")] == [{"on": True}]


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ({"topic": "/cmd_vel", "message": {"linear": {"x": "fast"}}}, "linear.x"),
        ({"topic": "/cmd_vel", "message": {}, "stop": {"speed": 0}}, "speed"),
        ({"topic": "/cmd_vel", "type": "std_msgs/msg/String"}, "topic /cmd_vel is geometry_msgs/msg/Twist, not std_ms"),
        ({"topic": "/elsewhere"}, "unknown topic '/elsewhere'"),
        ({"topic": "/elsewhere", "type": "no_msgs/msg/Such"}, "no_msgs/msg/Such"),
        ({"topic": "/cmd_vel", "timeout": 0}, "timeout is 0; it must be a number above 0, and at most 60 [s]"),
        ({"topic": "/cmd_vel", "timeout": "soon"}, 'timeout is "soon"; it must be'),
        ({"topic": "/cmd_vel", "type": 3}, "type is 3; it must be a string"),
    ],
)
def test_an_invalid_message_is_refused_and_nothing_is_published(ready, commanded, request_, reason):
    assert reason in ready.refused(op="publish", **request_)
    ready.do(op="publish", topic="/cmd_vel", message={})
    assert commanded.wait_for("cmd_vel") == [bytes(Twist().to_cdr())]


def test_the_stop_message_is_published_when_the_page_falls_silent(ready, commanded):
    go = {"linear": {"x": 1.0}}
    began = time.monotonic()
    for _ in range(3):
        ready.do(op="publish", topic="/cmd_vel", message=go, stop={}, timeout=0.4)
    got = commanded.wait_for("cmd_vel", 4)
    assert time.monotonic() - began >= 0.4
    assert [Twist.from_cdr(each).linear.x for each in got] == [1.0, 1.0, 1.0, 0.0]


def test_the_stop_message_is_published_at_once_when_the_page_leaves(ready, commanded):
    ready.do(op="publish", topic="/cmd_vel", message={"linear": {"x": 1.0}}, stop={}, timeout=60)
    commanded.wait_for("cmd_vel", 1)
    ready.close()
    assert [Twist.from_cdr(each).linear.x for each in commanded.wait_for("cmd_vel", 2)] == [1.0, 0.0]


def test_the_stop_message_is_published_when_the_relay_ends(commanded, new_relay, new_page, opened):
    relay = new_relay()
    page = new_page(relay)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="publish", topic="/cmd_vel", message={"linear": {"x": 1.0}}, stop={}, timeout=60)
    relay.close()
    assert [Twist.from_cdr(each).linear.x for each in commanded.wait_for("cmd_vel", 2)] == [1.0, 0.0]


def test_a_message_without_stop_ends_the_watch(ready, commanded):
    ready.do(op="publish", topic="/cmd_vel", message={"linear": {"x": 1.0}}, stop={}, timeout=0.2)
    ready.do(op="publish", topic="/cmd_vel", message={"linear": {"x": 2.0}})
    time.sleep(0.5)
    assert [Twist.from_cdr(each).linear.x for each in commanded.wait_for("cmd_vel", 2)] == [1.0, 2.0]


def test_a_drag_gets_the_viewer_a_number_and_a_token_and_ends_with_release(ready, commanded):
    viewer = ready.hello["viewer"]
    tokens = commanded.left(f"mjplug/@view/viewer/{viewer}")
    ready.do(op="drag", server=0, body=3, local=[0, 0, 0.1], target=[1, 2, 3])
    ready.do(op="drag", server=0, body="box", rotate=[1, 0, 0, 0])
    ready.do(op="drag", server=0, release=True)
    got = [json.loads(each) for each in commanded.wait_for("mjplug/@view/drag", 3)]
    assert got == [
        {"viewer": viewer, "seq": 1, "body": 3, "local": [0, 0, 0.1], "target": [1, 2, 3]},
        {"viewer": viewer, "seq": 2, "body": "box", "rotate": [1, 0, 0, 0]},
        {"viewer": viewer, "release": True},
    ]
    until(lambda: tokens == [True, False])


def test_a_page_that_leaves_releases_its_body(ready, commanded):
    ready.do(op="drag", server=0, body=3, target=[1, 2, 3])
    commanded.wait_for("mjplug/@view/drag")
    ready.close()
    assert json.loads(commanded.wait_for("mjplug/@view/drag", 2)[1])["release"] is True


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"body": None, "target": [0, 0, 0]}, "body is null; it must be the id or the name of a body"),
        ({"body": 1, "target": [0, 0]}, "target is [0, 0]; it must be a list of 3 numbers below 1e+10"),
        (
            {"body": 1, "rotate": [0, 0, True, 0]},
            "rotate is [0, 0, true, 0]; it must be a list of 4 numbers below 1e+10",
        ),
        ({"body": 1}, "target and rotate are missing; give at least one of them, or release: true"),
    ],
)
def test_an_invalid_drag_is_refused(ready, fields, reason):
    assert ready.refused(op="drag", server=0, **fields) == reason


def test_a_client_that_may_only_look_is_told_so(ready, commanded):
    commanded.permits = False
    sentence = "/mjplug permits this view only to look: its access rules give the client"
    for request in (
        {"op": "drag", "server": 0, "body": 1, "target": [0, 0, 0]},
        {"op": "publish", "topic": "/cmd_vel", "message": {}},
    ):
        for _ in range(2):
            assert ready.refused(**request).startswith(sentence)
    assert commanded.queried["mjplug/set_parameters"] == 1
    assert not commanded.received


def test_a_read_only_view_reads_and_refuses_everything_else(new_ready_page, commanded, requests):
    page = new_ready_page(read_only=True)
    assert page.hello["read_only"] is True
    assert page.do(op="call", service="~/list_parameters") == {"result": {"names": [], "prefixes": []}}
    for request in (
        {"op": "call", "service": "~/set_pause", "request": {"paused": True}},
        {"op": "publish", "topic": "/cmd_vel", "message": {}},
        {"op": "drag", "server": 0, "body": 1, "target": [0, 0, 0]},
    ):
        assert page.refused(**request).endswith("this view is read-only (--read-only)")
    assert requests == []
    assert not commanded.received


def test_calls_that_wait_are_limited_and_do_not_delay_other_requests(new_server, new_relay, new_page, monkeypatch):
    monkeypatch.setattr(commands, "MAX_CALLS", 2)
    waiting = []
    server = new_server(services={"/mjplug/slow": (PAUSE, waiting.append)})
    # Without this, the answer would come with the end of the query.
    server.session.declare_queryable("mjplug/slow", waiting.append)
    page = new_page(new_relay())
    if not page.hello["servers"]:
        page.text("servers")
    for number in range(2):
        page.send(op="call", service="~/slow", id=100 + number)
    assert page.refused(op="call", service="~/slow") == (
        "2 service calls are waiting, which is the maximum; try again later"
    )
    assert page.do(op="topics")["services"]
