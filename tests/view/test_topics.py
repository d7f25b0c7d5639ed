"""Topics: lists, definitions, samples."""

import pytest
from view.page_client import SAMPLES

from mjplug.view import channels, feeds
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String

LATCHED = {"reliability": "reliable", "durability": "transient_local", "depth": 2}


@pytest.fixture
def publishing(new_server, page):
    server = new_server(
        topics={"/clock": "rosgraph_msgs/msg/Clock", "/words": "std_msgs/msg/String", "/own": "own_msgs/msg/Lamp"},
        subscribed={"/cmd_vel": "geometry_msgs/msg/Twist"},
        services={"/mjplug/set_pause": ("mujoco_ros2_control_msgs/srv/SetPause", lambda query: b"")},
        types={
            "own_msgs/msg/Lamp": "own_msgs/Bulb[] bulbs\nstd_msgs/Header header\n",
            "own_msgs/msg/Bulb": "float64 power\n",
        },
    )
    if not page.hello["servers"]:
        page.text("servers")
    return server, page


def test_the_list_has_the_topics_and_services_of_all_servers(publishing):
    _, page = publishing
    found = page.do(op="topics")
    assert found["topics"][0] == {
        "name": "/clock", "type": "rosgraph_msgs/msg/Clock", "publishers": 1, "subscribers": 0, "server": 0,
    }  # fmt: skip
    assert [topic["name"] for topic in found["topics"]] == ["/clock", "/cmd_vel", "/own", "/words"]
    assert found["services"] == [
        {"name": "/mjplug/set_pause", "type": "mujoco_ros2_control_msgs/srv/SetPause", "server": 0}
    ]


def test_the_list_is_asked_for_again_only_after_a_change(publishing):
    server, page = publishing
    for _ in range(3):
        page.do(op="topics")
    assert server.queried["mjplug/interfaces"] == 1
    server.matched("mjplug/interfaces")
    server.publisher("mjplug/interfaces").put(b"")
    until = 200
    while server.queried["mjplug/interfaces"] == 1 and until:
        page.do(op="topics")
        until -= 1
    assert server.queried["mjplug/interfaces"] == 2


def test_the_newest_sample_comes_as_cdr_with_the_number_of_lost_ones(publishing, new_page, new_relay):
    server, _ = publishing
    page = new_page(new_relay(), acknowledges=False)
    if not page.hello["servers"]:
        page.text("servers")
    subscribed = page.do(op="subscribe", topic="/clock", mode="newest")
    assert subscribed["type"] == "rosgraph_msgs/msg/Clock"
    assert "builtin_interfaces/Time clock\n" in subscribed["definition"]
    assert "=" * 80 + "\nMSG: builtin_interfaces/Time\n" in subscribed["definition"]
    server.matched("clock")
    messages = [Clock(clock=Time(sec=number)) for number in range(6)]
    for number, message in enumerate(messages):
        server.send("/clock", message)
        if number < 2:
            item = page.item(SAMPLES)
            assert (item.channel, item.samples) == (subscribed["channel"], [(bytes(message.to_cdr()), 0)])
    assert page.nothing()
    page.acknowledge(2)
    assert page.item(SAMPLES).samples == [(bytes(messages[5].to_cdr()), 3)]


def test_all_samples_come_in_order_and_padded_to_eight_bytes(publishing, new_page, new_relay):
    server, _ = publishing
    page = new_page(new_relay(), acknowledges=False)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="subscribe", topic="/words", mode="all")
    server.matched("words")
    texts = ["a" * number for number in range(20)]
    for text in texts:
        server.send("/words", String(data=text))
    got, batch = [], 0
    while len(got) < len(texts):
        item = page.item(SAMPLES)
        assert len(item.payload) % 8 == 0
        got += item.samples
        page.acknowledge(item.batch)
        batch = item.batch
    assert batch >= 1
    assert got == [(bytes(String(data=text).to_cdr()), 0) for text in texts]


def test_samples_above_the_limit_are_dropped_from_the_oldest_on_and_counted(
    publishing, new_page, new_relay, monkeypatch
):
    monkeypatch.setattr(channels, "MAX_SAMPLES", 5)
    monkeypatch.setattr(feeds, "MAX_SAMPLES", 5)
    server, _ = publishing
    page = new_page(new_relay(), acknowledges=False)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="subscribe", topic="/clock", mode="all")
    server.matched("clock")
    for number in range(2):
        server.send("/clock", Clock(clock=Time(sec=number)))
        page.item(SAMPLES)
    for number in range(2, 22):
        server.send("/clock", Clock(clock=Time(sec=number)))
    assert page.nothing()
    page.acknowledge(2)
    samples = page.item(SAMPLES).samples
    assert [Clock.from_cdr(cdr).clock.sec for cdr, _ in samples] == [17, 18, 19, 20, 21]
    assert [lost for _, lost in samples] == [15, 0, 0, 0, 0]


def test_a_second_page_gets_the_last_samples_of_a_latched_topic(new_server, new_relay, new_page):
    server = new_server(topics={"/description": ("std_msgs/msg/String", LATCHED)})
    relay = new_relay()
    first = new_page(relay)
    if not first.hello["servers"]:
        first.text("servers")
    first.do(op="subscribe", topic="/description", mode="newest")
    server.matched("description")
    server.send("/description", String(data="robot"))
    first.item(SAMPLES)
    second = new_page(relay)
    second.do(op="subscribe", topic="/description", mode="all")
    assert [String.from_cdr(cdr).data for cdr, _ in second.item(SAMPLES).samples] == ["robot"]


def test_json_on_the_key_of_a_topic_is_converted_and_garbage_counts_as_lost(publishing):
    server, page = publishing
    page.do(op="subscribe", topic="/words", mode="all")
    server.matched("words")
    server.publisher("words").put(b"garbage")
    server.publisher("words").put(b'{"data": "hello"}')
    (cdr, lost), = page.item(SAMPLES).samples  # fmt: skip
    assert (String.from_cdr(cdr).data, lost) in [("hello", 1), ("hello", 0)]


def test_a_type_that_only_the_server_knows_has_its_definition_with_nested_types(publishing):
    _, page = publishing
    definition = page.do(op="subscribe", topic="/own", mode="newest")["definition"]
    assert definition.startswith("own_msgs/Bulb[] bulbs\n")
    for nested in ("own_msgs/Bulb", "std_msgs/Header", "builtin_interfaces/Time"):
        assert definition.count(f"MSG: {nested}\n") == 1


def test_definitions_of_messages_and_services(publishing):
    _, page = publishing
    assert "geometry_msgs/Vector3 linear" in page.do(op="definition", type="geometry_msgs/msg/Twist")["definition"]
    service = page.do(op="definition", type="mujoco_ros2_control_msgs/srv/SetPause")
    assert "bool paused" in service["request"]
    assert "bool success" in service["response"]
    assert "own_msgs/Bulb[] bulbs" in page.do(op="definition", type="own_msgs/msg/Lamp")["definition"]
    assert "geometry_msgs/msg/Twist" in page.refused(op="definition", type="geometry_msgs/msg/Twits")


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ({"op": "subscribe", "topic": "/clokc", "mode": "all"}, "unknown topic '/clokc', did you mean '/clock'?"),
        (
            {"op": "subscribe", "topic": "/clock", "mode": "some"},
            'mode is "some"; it must be one of: newest, all, im',
        ),
        ({"op": "subscribe", "topic": 5, "mode": "all"}, "the name is 5; it must be a string such as /clock"),
        ({"op": "subscribe", "topic": "/a//b", "mode": "all"}, "'/a//b' is not a valid ROS name"),
        ({"op": "subscribe", "topic": "/clock", "mode": "image"}, "the topic is rosgraph_msgs/msg/Clock; a topic of"),
        ({"op": "unsubscribe", "channel": 9}, "channel is 9; open channels: none"),
        ({"op": "unsubscribe", "channel": [9]}, "channel is [9]; open channels: none"),
    ],
)
def test_an_invalid_subscription_is_refused_with_the_reason(publishing, request_, reason):
    _, page = publishing
    assert page.refused(**request_).startswith(reason)


def test_the_number_of_subscriptions_is_limited_and_unsubscribing_makes_room(publishing, monkeypatch):
    monkeypatch.setattr(channels, "MAX_CHANNELS", 3)
    server, page = publishing
    numbers = [page.do(op="subscribe", topic="/clock", mode="newest")["channel"] for _ in range(3)]
    assert numbers == [1, 2, 3]
    assert page.refused(op="subscribe", topic="/clock", mode="newest") == (
        "3 topics are subscribed to, which is the maximum"
    )
    page.do(op="unsubscribe", channel=2)
    assert page.do(op="subscribe", topic="/clock", mode="newest")["channel"] == 4
    for number in (1, 3, 4):
        page.do(op="unsubscribe", channel=number)
    server.unmatched("clock")
