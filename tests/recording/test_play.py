"""Playbacks: order, pace, keys, loops, and what others receive."""

import struct
import time
from collections import deque

import pytest
from recording.conftest import TIMEOUT, Publishing, Recording
from recording.readers import by_mcap, by_rosbags
from recording.test_bags import STATIC, TOLD, new_bag, told
from wire.conftest import Client

from mjplug.bag.definitions import text_of_class
from mjplug.bag.reader import Bag
from mjplug.bag.topics import BagTopic
from mjplug.bag.writer import Limits, Record
from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED
from mjplug.player.outputs import LivePublisherError, Outputs, chosen_topics, refuse_live_publishers
from mjplug.player.pace import Pace
from mjplug.player.player import Player
from mjplug.recorder.selection import Selection
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug_schemas.diagnostic_msgs import DiagnosticArray
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String, UInt64


def test_messages_are_due_by_their_times_and_the_rate():
    pace = Pace(rate=2.0)
    pace.start(10 * 10**9, now=100.0)
    assert pace.wait(10 * 10**9, 100.0) == 0.0
    assert pace.wait(14 * 10**9, 100.0) == pytest.approx(2.0)
    assert pace.position(101.0) == 12 * 10**9
    pace.set_rate(0.5, 101.0)
    assert pace.wait(14 * 10**9, 101.0) == pytest.approx(4.0)
    pace.pause(True, 102.0)
    assert pace.wait(14 * 10**9, 500.0) == float("inf")
    pace.pause(False, 600.0)
    assert pace.position(600.0) == 12_500_000_000
    # A delay of 0.1 s is made up for, one of 1 s stays.
    assert pace.wait(12_500_000_000, 600.1) == 0.0
    assert (pace.position(600.1), pace.delays) == (12_550_000_000, 0)
    assert pace.wait(12_500_000_000, 601.1) == 0.0
    assert (pace.position(601.1), pace.delays) == (12_500_000_000, 1)
    for rate, limited in ((1e9, 100.0), (0.0, 0.01)):
        pace.set_rate(rate, 700.0)
        assert pace.rate == limited


class Heard:
    """Keeps what is published."""

    def __init__(self):
        self.messages, self.epochs, self.clocks = [], [], []
        self.player = None

    def publish(self, topic, data):
        self.messages.append((topic, self.player.now(), data))
        return True

    def publish_clock(self, time_ns):
        self.clocks.append(time_ns)

    def publish_epoch(self, epoch):
        self.epochs.append(epoch)


def nothing(timeout):
    time.sleep(timeout)
    return []


def play(folder, keys=nothing, pace=None, **options):
    """What a playback of all topics publishes."""
    bag, heard = Bag(folder), Heard()
    topics = frozenset(chosen_topics(bag, lambda name: True))
    heard.player = Player(bag, topics, pace or Pace(100.0), keys, **options)
    heard.ended = heard.player.run(heard)
    return heard


def static(value, seconds=0.0, sequence=1):
    return Record("/static", round(seconds * 1e9), 7, sequence, UInt64(data=value).to_cdr())


def bag_of(folder, *records, **options):
    bag = new_bag(folder, **options)
    for record in records:
        bag.write(record)
    bag.finish()
    return folder


def test_every_message_is_played_once_in_order_also_from_a_split_bag(tmp_path):
    records = [static(5), *(told(number, 0.1 * number) for number in range(100))]
    bag_of(tmp_path / "bag", *records, limits=Limits(duration_ns=2 * 10**9))
    assert len(by_rosbags(tmp_path / "bag")) == 105
    heard = play(tmp_path / "bag")
    assert heard.messages == [(record.topic, (record.log_time, 0), record.data) for record in records]
    assert (heard.epochs, heard.ended, heard.player.played) == ([0], True, 101)


def test_where_a_bag_jumps_back_the_epoch_grows(tmp_path):
    bag = new_bag(tmp_path / "bag")
    bag.write(static(5))
    for number in range(10):
        bag.write(told(number, 5.0 + 0.1 * number))
    bag.begin_part({"epoch": "/mjplug 4"})
    for number in range(10):
        bag.write(told(number, 1.0 + 0.1 * number))
    bag.finish()
    heard = play(tmp_path / "bag")
    assert heard.epochs == [0, 1]
    assert [now[1] for topic, now, _ in heard.messages if topic == "/told"] == [0] * 10 + [1] * 10


def test_a_loop_announces_each_new_round(tmp_path):
    bag_of(tmp_path / "bag", *(told(number, 0.1 * number) for number in range(5)))
    rounds = deque([[]] * 30 + [["stop"]])

    def keys(timeout):
        time.sleep(timeout)
        return rounds.popleft()

    heard = play(tmp_path / "bag", keys, loop=True)
    assert not heard.ended
    # It may end after a round was announced and before its first message.
    assert heard.epochs == list(range(len(heard.epochs)))
    assert {now[1] for _, now, _ in heard.messages} >= {*heard.epochs[:-1]}
    assert len(heard.epochs) >= 2
    assert [data for _, _, data in heard.messages[5:10]] == [data for _, _, data in heard.messages[:5]]


def test_the_offset_leaves_out_all_but_latched_messages(tmp_path):
    records = [static(1), static(2, 0.5, 2), *(told(number, 0.1 * number) for number in range(20))]
    bag_of(tmp_path / "bag", *records)
    heard = play(tmp_path / "bag", start_offset_ns=10**9)
    assert [(topic, now[0]) for topic, now, _ in heard.messages] == [
        ("/static", 10**9), ("/static", 10**9), *(("/told", record.log_time) for record in records[12:]),
    ]  # fmt: skip


def test_the_keys_pause_step_and_change_the_rate(tmp_path):
    bag_of(tmp_path / "bag", *(told(number, 100.0 * number) for number in range(5)))
    pressed = deque([["next"], [], ["next", "next"], [], [], ["faster"], ["slower"], ["slower"], ["stop"]])
    pace = Pace(1.0, paused=True)
    heard = play(tmp_path / "bag", lambda timeout: pressed.popleft(), pace)
    assert [now[0] for _, now, _ in heard.messages] == [0, 100 * 10**9, 200 * 10**9]
    assert pace.rate == pytest.approx(1.0 / 1.1)
    pressed = deque([[], ["pause"], ["pause"], ["stop"]])
    assert [now[0] for _, now, _ in play(tmp_path / "bag", lambda timeout: pressed.popleft(), Pace()).messages] == [0]


def test_the_clock_is_published_between_messages_and_does_not_overtake_them(tmp_path):
    bag_of(tmp_path / "bag", told(0, 50.0), told(1, 60.0))
    heard = play(tmp_path / "bag", clock_rate=500.0)
    assert heard.clocks == sorted(heard.clocks)
    assert len(heard.clocks) > 5
    assert 50 * 10**9 <= heard.clocks[0] <= heard.clocks[-1] <= 60 * 10**9


@pytest.fixture
def playing(opened, tmp_path):
    """Opens the network of a playback, which is a router on a free port."""

    def begin(folder, pace, remap=None, clock=0.0):
        bag = Bag(folder)
        topics = chosen_topics(bag, lambda name: True)
        player = Player(bag, frozenset(topics), pace, nothing, clock_rate=clock)
        settings = SessionSettings(listen=("tcp/127.0.0.1:0",))
        network = opened(open_network(settings, "/mjplug_play", ros2=RosSettings(), now=player.now))
        return player, network, Outputs(network, topics, remap or {}, clock > 0.0)

    return begin


def test_what_is_recorded_from_a_playback_is_what_was_played(opened, playing, tmp_path):
    own = BagTopic("/lab/reading", "lab_msgs/msg/Reading", "float64[] values\nstring label\n")
    bag = new_bag(tmp_path / "bag")
    bag.add_topic(own)
    records = []
    for number in range(200):
        records.append(told(number, 3.0 + 0.005 * number))
        # Equal times, and a type that nobody here knows: an empty sequence and "a".
        records.append(
            Record(own.name, records[-1].log_time, 7, number + 1, b"\0\1\0\0" + struct.pack("<II", 0, 2) + b"a\0")
        )
    for record in records:
        bag.write(record)
    bag.finish()
    player, network, outputs = playing(tmp_path / "bag", Pace(1.0))
    recording = opened(Recording(network.session.endpoint, tmp_path / "again", Selection(all=True), "sim", 1 << 29))
    publishers = outputs._publishers.values()
    recording.until(lambda: all(publisher.writers[0].matched for publisher in publishers))
    assert player.run(outputs)
    recording.until(lambda: sum(t.written for t in recording.recorder.topics.values()) >= 401)
    recording.finish()
    assert recording.recorder.total("lost") == 0
    first, second = (by_mcap(tmp_path / name / f"{name}_0.mcap") for name in ("bag", "again"))
    for name in ("/told", own.name):
        assert [(r.type, r.log_time, r.data) for r in second if r.topic == name] == [
            (r.type, r.log_time, r.data) for r in first if r.topic == name
        ]
    assert len(first) == 400
    definitions = {t.name: t.definition for f in Bag(tmp_path / "again").summaries() for t in f.topics.values()}
    assert definitions[own.name] == own.definition


def test_others_get_played_messages_on_all_keys_and_latched_ones_later(playing, opened, tmp_path):
    bag_of(tmp_path / "bag", static(5), *(told(number, 0.1 * number) for number in range(3)))
    player, network, outputs = playing(tmp_path / "bag", Pace(10.0), {"/told": "/played/told"}, clock=100.0)
    client = opened(Client(network.session.endpoint))
    keys = ("played/told", "played/told/@json", RosSettings().data_key("/played/told", String), "clock")
    samples = [client.listen(key) for key in keys]
    publisher = outputs._publishers["/told"]
    until = time.monotonic() + TIMEOUT
    while not all(writer.matched for writer in publisher.writers) or not outputs._clock.matched:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert player.run(outputs)
    for number in range(3):
        plain, json, ros = (queue.get(timeout=TIMEOUT) for queue in samples[:3])
        assert bytes(plain.payload) == bytes(ros.payload) == told(number, 0).data
        assert String.from_json(bytes(json.payload)).to_cdr() == told(number, 0).data
        assert struct.unpack_from("<qqB", bytes(ros.attachment))[::2] == (number + 1, 16)
        assert struct.unpack("<qqB16sqI", bytes(plain.attachment))[4:] == (number * 10**8, 0)
    clock = Clock.from_cdr(bytes(samples[3].get(timeout=TIMEOUT).payload)).clock
    assert clock.sec == 0
    (reply,) = client.session.get("static", timeout=TIMEOUT)
    assert bytes(reply.ok.payload) == UInt64(data=5).to_cdr()
    assert network.listing.name == "/mjplug_play"


def test_a_playback_does_not_fight_a_live_publisher(opened, tmp_path):
    live = opened(Publishing())
    live.publisher("/told", String, DEFAULT)
    live.publisher("/diagnostics", DiagnosticArray, DEFAULT)
    settings = SessionSettings(mode="client", connect=(live.endpoint,))
    network = opened(open_network(settings, "/mjplug_play", ros2=RosSettings()))
    session = network.session.zenoh
    with pytest.raises(LivePublisherError, match=r"^/mjplug publishes /told: .*--remap /a:=/b, or .*--force"):
        refuse_live_publishers(session, 0, {"/told": String.TYPE, "/free": String.TYPE})
    # Other topics, topics that many publish, and what the playback itself publishes.
    refuse_live_publishers(session, 0, {"/free": String.TYPE, "/diagnostics": DiagnosticArray.TYPE})
    played = {"/mine": TOLD, "/static": STATIC}
    Outputs(network, {name: BagTopic(name, t.type, t.definition) for name, t in played.items()}, {}, clock=False)
    refuse_live_publishers(session, 0, {"/mine": String.TYPE})
    # A ROS 2 node that is no server.
    token = live.network.session.zenoh.liveliness().declare_token(
        "@ros2_lv/0/abc/0/1/MP/%/%arm/talker/%chatter/std_msgs::msg::dds_::String_/RIHS01_0/::,10:,:,:,,"
    )
    with pytest.raises(LivePublisherError, match=r"^/arm/talker publishes /chatter"):
        refuse_live_publishers(session, 0, {"/chatter": String.TYPE})
    del token


def test_topics_that_cannot_be_played_are_named_and_the_others_are_played(playing, tmp_path):
    bag = new_bag(tmp_path / "bag")
    bag.add_topic(BagTopic("/odd", "lab_msgs/msg/Odd", "Missing x\n"))
    bag.add_topic(BagTopic("/clock", Clock.TYPE, text_of_class(Clock), "", CLOCK))
    bag.add_topic(BagTopic("/latched", String.TYPE, text_of_class(String), "", LATCHED))
    for number, topic in enumerate(("/odd", "/clock", "/told", "/latched")):
        bag.write(Record(topic, number, 7, 1, bytes(16)))
    bag.finish()
    player, _, outputs = playing(tmp_path / "bag", Pace(1.0), {"/latched": "/1bad"}, clock=10.0)
    assert {name: why.partition(";")[0].split()[0] for name, why in outputs.skipped.items()}.keys() == {
        "/odd", "/clock", "/latched",
    }  # fmt: skip
    assert "missing" in outputs.skipped["/odd"]
    assert player.run(outputs)
    assert player.played == 1
