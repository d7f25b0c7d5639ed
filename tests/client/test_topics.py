"""Topics, read and written through a live server."""

import threading
import time
from collections import deque
from functools import partial

import numpy as np
import pytest
from waits import TIMEOUT

from mjplug.client import ClientError, TimedOutError, UnknownNameError, WrongTypeError
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String, UInt64


def seconds(clock):
    return clock.clock.sec + clock.clock.nanosec / 1e9


def test_topics_are_listed_with_type_key_quality_of_service_and_ends(client):
    topics = client.topics()
    assert list(topics) == sorted(topics)
    epoch, command = topics["/mjplug/epoch"], topics["/cmd_vel"]
    assert (epoch.type, epoch.key, epoch.json_key) == ("std_msgs/msg/UInt64", "mjplug/epoch", "mjplug/epoch/@json")
    assert (epoch.latched, epoch.reliability, epoch.depth) == (True, "reliable", 1)
    assert (epoch.publishers, epoch.subscribers) == (("/mjplug",), ())
    assert (command.publishers, command.subscribers, command.latched) == ((), ("/mjplug",), False)


def test_iterating_yields_every_message_in_order_until_the_subscription_is_closed(client):
    times = []
    with client.subscribe("/clock", Clock) as clock:
        for message in clock:
            times.append(seconds(message))
            if len(times) == 20:
                clock.close()
    # What was in the queue already may still come.
    assert len(times) >= 20
    # The first listener gets the time at once, whenever that is.
    assert np.allclose(np.diff(times[1:]), 0.01)
    with pytest.raises(ClientError, match=r"the subscription to /clock is closed"):
        clock.next(0.0)


def test_the_type_may_be_a_class_a_name_dict_or_left_to_the_server(client):
    assert isinstance(client.subscribe("/clock").next(TIMEOUT), Clock)
    assert isinstance(client.subscribe("clock", "rosgraph_msgs/msg/Clock").next(TIMEOUT), Clock)
    assert set(client.subscribe("/clock", dict).next(TIMEOUT)["clock"]) == {"sec", "nanosec"}


def test_a_latched_topic_gives_its_last_message_at_once(client):
    before = client.subscribe("~/epoch").next(TIMEOUT)
    client.call("~/reset_world")
    assert client.subscribe("~/epoch", UInt64).next(TIMEOUT) == UInt64(data=before.data + 1)


def test_how_much_of_the_past_a_subscription_asks_for_can_be_chosen(client):
    assert client.subscribe("~/epoch", history=1).next(TIMEOUT) is not None
    with pytest.raises(TimedOutError):
        client.subscribe("~/epoch", history=0).next(0.3)


def test_messages_are_had_as_they_come(client):
    raw = client.subscribe("~/epoch", bytes).next(TIMEOUT)
    assert type(raw) is bytes
    assert UInt64.from_cdr(raw) == client.subscribe("~/epoch").next(TIMEOUT)
    with pytest.raises(WrongTypeError, match="is not a message type"):
        client.publisher("/cmd_vel", bytes)


def test_a_topic_that_no_server_has_needs_its_type(client):
    for attempt in (client.publisher, client.subscribe):
        with pytest.raises(
            UnknownNameError, match=r"unknown topic '/foo'; .*; if the name is right, give its type, such"
        ):
            attempt("/foo")
    assert client.publisher("/foo", "geometry_msgs/msg/Twist").type is Twist


def test_latest_is_the_newest_message_however_many_have_come(client):
    with client.subscribe("/clock", depth=1) as clock:
        assert clock.latest(TIMEOUT) is not None
        until = clock.next(TIMEOUT).clock.sec + 1
        while clock.next(TIMEOUT).clock.sec < until:
            pass
        # Taking the messages does not take the newest one away.
        assert clock.latest().clock.sec >= until
    assert client.subscribe("/cmd_vel", Twist).latest() is None


def test_a_callback_gets_each_message_and_its_exceptions_end_nothing(client, caplog):
    got, enough = [], threading.Event()

    def callback(message):
        got.append(message)
        if len(got) == 1:
            raise RuntimeError("a bug of mine")
        if len(got) == 5:
            enough.set()

    client.subscribe("/clock", Clock, callback)
    assert enough.wait(TIMEOUT)
    assert all(isinstance(message, Clock) for message in got)
    assert "the callback for /clock failed" in caplog.text
    assert "a bug of mine" in caplog.text


def test_who_is_slow_loses_the_oldest_messages_and_can_count_them(client):
    with client.subscribe("/clock", depth=3) as clock, client.subscribe("/clock", depth=1000) as all_of_it:
        while clock.dropped < 5:
            all_of_it.next(TIMEOUT)
        waiting = [seconds(clock.next(TIMEOUT)) for _ in range(3)]
    assert np.all(np.diff(waiting) > 0)


def test_a_published_command_reaches_the_simulation(client):
    client.publish("/cmd_vel", Twist(linear=Vector3(x=0.25)))
    client.publish("cmd_vel", {"linear": {"x": 0.25}, "angular": {"z": np.float64(0.5)}})
    publisher = client.publisher("/cmd_vel")
    assert publisher.wait_for_subscriber(TIMEOUT)
    assert publisher.matched
    assert publisher.type is Twist
    heard = client.subscribe("/cmd_vel")
    publisher.publish({"linear": {"x": 2}})
    assert heard.next(TIMEOUT) == Twist(linear=Vector3(x=2.0))


def test_a_publisher_that_was_closed_is_replaced(client):
    with client.publisher("/cmd_vel") as first:
        assert client.publisher("/cmd_vel") is first
    with pytest.raises(ClientError, match=r"the publisher of /cmd_vel is closed"):
        first.publish(Twist())
    client.publish("/cmd_vel", Twist())


def test_topics_between_clients_need_no_server_that_knows_them(client):
    with client.subscribe("/chatter", String) as heard:
        client.publish("/chatter", String(data="hello"))
        assert heard.next(TIMEOUT) == String(data="hello")
    with client.subscribe("/chatter", String) as heard, client.publisher("/chatter", dict) as json:
        assert json.wait_for_subscriber(TIMEOUT)
        json.publish({"data": "in JSON"})
        assert heard.next(TIMEOUT) == String(data="in JSON")
        json.publish({"date": 1})
        with pytest.raises(WrongTypeError, match=r"a message on /chatter cannot be decoded: .*'date'.*'data'"):
            heard.next(TIMEOUT)


@pytest.mark.parametrize(
    ("name", "kind", "error", "sentence"),
    [
        ("/epoch", None, UnknownNameError, r"unknown topic '/epoch', did you mean '/mjplug/epoch'\?"),
        (
            "/clok",
            None,
            UnknownNameError,
            r"unknown topic '/clok', did you mean '/clock'\?; there are: .*/mjplug/epoch",
        ),
        ("/clock", String, WrongTypeError, r"topic /clock is rosgraph_msgs/msg/Clock, not std_msgs/msg/String"),
        ("/clock", "std_msgs/msg/Strin", WrongTypeError, r"unknown type .*did you mean 'std_msgs/msg/String'\?"),
        ("/clock", "std_srvs/srv/Trigger", WrongTypeError, r"std_srvs/srv/Trigger is a service"),
        ("/clock", int, WrongTypeError, r"<class 'int'> is not a message type"),
        ("/clo ck", None, ClientError, r"'/clo ck' is not a valid ROS name: ' ' is not allowed"),
    ],
)
def test_a_wrong_topic_is_refused_in_words(client, name, kind, error, sentence):
    with pytest.raises(error, match=sentence):
        client.subscribe(name, kind)


def test_a_wrong_message_is_refused_before_it_leaves(client):
    with pytest.raises(WrongTypeError, match=r"Twist: unknown field 'lineal', did you mean 'linear'\?"):
        client.publish("/cmd_vel", {"lineal": {"x": 1.0}})
    with pytest.raises(WrongTypeError, match=r"linear\.x must be a float64"):
        client.publish("/cmd_vel", {"linear": {"x": "fast"}})
    with pytest.raises(WrongTypeError, match=r"topic /cmd_vel is geometry_msgs/msg/Twist, not std_msgs/msg/String"):
        client.publish("/cmd_vel", String())
    with pytest.raises(WrongTypeError, match=r"expected geometry_msgs/msg/Twist, not std_msgs/msg/String"):
        client.publisher("/cmd_vel").publish(String())
    with pytest.raises(WrongTypeError, match=r"cannot be written in JSON"):
        client.publish("/cmd_vel", {"linear": object()})


def test_waits_end_in_time(client):
    client.call("~/set_pause", paused=True)
    with client.subscribe("/mujoco_heartbeat") as heartbeat:
        began = time.monotonic()
        with pytest.raises(TimedOutError, match=r"no message on /mujoco_heartbeat within 0\.2 s"):
            deque(iter(partial(heartbeat.next, 0.2), None))
        assert time.monotonic() - began < TIMEOUT
    with pytest.raises(TimedOutError, match=r"no subscriber for /unheard within 0\.1 s"):
        client.publish("/unheard", String(), timeout=0.1)
    with pytest.raises(TimedOutError, match=r"no topic, service or action /later appeared within 0\.1 s"):
        client.wait_for("/later", 0.1)
    assert client.wait_for("~/set_pause").type == "mujoco_ros2_control_msgs/srv/SetPause"
    assert client.wait_for("clock").name == "/clock"
