"""What the recorder writes, read by others."""

import re
import struct
import time

import pytest
import yaml
import zenoh
from recording.conftest import Publishing, Recording
from recording.readers import by_mcap, by_rosbags, metadata_of

from mjplug.bag.errors import BagError
from mjplug.bag.writer import Limits
from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED, QoS, Topic
from mjplug.recorder.selection import Selection
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.idl import float64, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.sensor_msgs import CompressedImage, Image, JointState
from mjplug_schemas.std_msgs import Header, String
from mjplug_schemas.tf2_msgs import TFMessage


class Reading(Message, package="lab_msgs"):
    """A type that no reader knows."""

    header: Header = Header()
    values: sequence[float64] = ()
    label: string = ""


def test_every_message_is_read_by_rosbags_and_mcap_with_its_bytes_and_its_simulated_time(publishing, record, tmp_path):
    types = {
        "/joint_states": (JointState, DEFAULT),
        "/image": (Image, QoS(depth=5, reliability="best_effort")),
        "/image/compressed": (CompressedImage, DEFAULT),
        "/lab/reading": (Reading, DEFAULT),
        "/told": (String, DEFAULT),
        "/tf_static": (TFMessage, LATCHED),
    }
    publishers = {name: publishing.publisher(name, *how) for name, how in types.items()}
    recording = record(*publishers.values())
    sent = []
    for number in range(40):
        publishing.at(number * 0.01)
        for name, message in (
            ("/joint_states", JointState(name=("a", "b"), position=(number, 0.5))),
            ("/image", Image(height=2, width=100, step=100, data=bytes([number]) * 200)),
            ("/image/compressed", CompressedImage(format="jpeg", data=bytes(number))),
            ("/lab/reading", Reading(values=(1.0,) * number, label="ä")),
            # Equal and empty messages are messages too.
            ("/told", String()),
            ("/told", String()),
        ):
            publishers[name].publish(message)
            sent.append((name, publishing.now[0], message.to_cdr()))
    recording.arrived(len(sent))
    recording.finish()
    read = by_rosbags(tmp_path / "bag")
    assert sorted((r.topic, r.log_time, r.data) for r in read) == sorted(sent)
    assert {r.topic: r.type for r in read} == {name: how[0].TYPE for name, how in types.items() if name != "/tf_static"}
    for name in types:
        # In the order of sending.
        assert [r.data for r in read if r.topic == name] == [data for topic, _, data in sent if topic == name]
    assert [(r.topic, r.log_time, r.data) for r in by_mcap(tmp_path / "bag" / "bag_0.mcap")] == [
        (r.topic, r.log_time, r.data) for r in read
    ]
    assert recording.recorder.total("lost") == 0
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (about["version"], about["storage_identifier"], about["message_count"]) == (8, "mcap", len(sent))
    assert about["duration"] == {"nanoseconds": 390_000_000}
    assert about["custom_data"]["clock"] == "sim"
    assert "mjplug_open" not in about["custom_data"]
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in about["topics_with_message_count"]}
    # A topic without messages is in the list.
    assert counts["/tf_static"] == 0
    assert counts["/told"] == 80
    latched = next(t for t in about["topics_with_message_count"] if t["topic_metadata"]["name"] == "/tf_static")
    (qos,) = yaml.safe_load(latched["topic_metadata"]["offered_qos_profiles"])
    assert (qos["durability"], qos["reliability"], qos["depth"]) == (1, 1, 1)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_every_compression_is_read(publishing, record, tmp_path, compression):
    publisher = publishing.publisher("/told", String, DEFAULT)
    recording = record(publisher, compression=compression)
    for number in range(300):
        publisher.publish(String(data=f"{number} " * 1000))
    recording.arrived(300)
    recording.finish()
    expected = [String(data=f"{number} " * 1000).to_cdr() for number in range(300)]
    # More than one chunk.
    assert [r.data for r in by_mcap(tmp_path / "bag" / "bag_0.mcap")] == expected
    assert [r.data for r in by_rosbags(tmp_path / "bag")] == expected


@pytest.mark.parametrize("limits", [Limits(bytes=20_000), Limits(duration_ns=500_000_000)], ids=["size", "duration"])
def test_latched_messages_are_at_the_beginning_of_each_file_of_a_split_bag(publishing, record, tmp_path, limits):
    told = publishing.publisher("/told", String, DEFAULT)
    first, second = (publishing.publisher("/tf_static", TFMessage, LATCHED) for _ in range(2))
    recording = record(told, first, second, limits=limits, compression="none")
    # Two publishers of one latched topic: the last message of each counts.
    first.publish(TFMessage())
    for publisher in (first, second):
        publisher.publish(TFMessage())
    for number in range(100):
        publishing.at(number * 0.02)
        told.publish(String(data=str(number) * 500))
        recording.arrived(number + 4)
    recording.finish()
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert len(files) >= 4
    numbers = []
    for path in files:
        read = by_mcap(path)
        assert [r.topic for r in read].count("/tf_static") == (3 if path.name == "bag_0.mcap" else 2)
        if path.name != "bag_0.mcap":
            assert [r.topic for r in read[:2]] == ["/tf_static"] * 2
            assert {r.log_time for r in read[:2]} == {read[2].log_time}
            assert metadata_of(path)["repeated"] == "2"
        numbers += [r.data for r in read if r.topic == "/told"]
        if limits.bytes:
            assert path.stat().st_size < 2 * limits.bytes
        else:
            assert read[-1].log_time - read[0].log_time < limits.duration_ns
    assert numbers == [String(data=str(number) * 500).to_cdr() for number in range(100)]
    assert len(by_rosbags(tmp_path / "bag")) == 103 + 2 * (len(files) - 1)


def test_a_new_epoch_begins_a_new_file_and_late_messages_go_to_the_file_before(publishing, record, tmp_path):
    told, images = publishing.publisher("/told", String, DEFAULT), publishing.publisher("/image", Image, DEFAULT)
    recording = record(told, images)
    publishing.at(5.0)
    told.publish(String(data="before"))
    recording.arrived(1)
    # A restored state: time goes back.
    publishing.at(1.0, epoch=1)
    told.publish(String(data="after"))
    recording.arrived(2)
    # Of a worker process that was still busy with the state before.
    publishing.at(5.0)
    images.publish(Image())
    recording.arrived(3)
    publishing.at(1.1, epoch=1)
    told.publish(String(data="after"))
    recording.arrived(4)
    recording.finish()
    first, second = (by_mcap(tmp_path / "bag" / f"bag_{number}.mcap") for number in range(2))
    assert [(r.topic, r.log_time) for r in first] == [("/told", 5 * 10**9), ("/image", 5 * 10**9)]
    assert [(r.topic, r.log_time) for r in second] == [("/told", 10**9), ("/told", 1_100_000_000)]
    assert metadata_of(tmp_path / "bag" / "bag_1.mcap")["epoch"] == "/mjplug 1"
    assert recording.notices == [
        "/mjplug was reset, or a state was restored (epoch 1): the bag continues in a new file"
    ]


def test_a_server_that_is_started_again_begins_a_new_file_without_its_old_latched_messages(opened, tmp_path):
    router = opened(Publishing())
    first = opened(Joined(router.endpoint))
    told, latched = first.publisher("/told", String, DEFAULT), first.publisher("/static", String, LATCHED)
    selection = Selection(regex=re.compile("told|static"))
    recording = opened(Recording(router.endpoint, tmp_path / "bag", selection, "sim", 1 << 29))
    recording.until(lambda: told.writers[0].matched)
    first.at(9.0)
    latched.publish(String(data="old"))
    told.publish(String(data="one"))
    recording.arrived(2)
    first.close()
    second = opened(Joined(router.endpoint))
    told = second.publisher("/told", String, DEFAULT)
    recording.until(lambda: told.writers[0].matched and len(recording.recorder.sources._hosts) == 3)
    told.publish(String(data="two"))
    recording.arrived(3)
    recording.finish()
    read = by_mcap(tmp_path / "bag" / "bag_1.mcap")
    assert [(r.topic, r.log_time) for r in read] == [("/told", 0)]
    assert recording.notices == ["/robot/mjplug was started again: the bag continues in a new file"]


class Joined(Publishing):
    """A server on the network of another one."""

    def __init__(self, endpoint):
        self.now = (0, 0)
        settings = SessionSettings(mode="client", connect=(endpoint,))
        self.network = open_network(settings, "/robot/mjplug", now=lambda: self.now)


def test_messages_that_do_not_fit_into_memory_are_dropped_and_counted(publishing, record, tmp_path):
    publisher = publishing.publisher("/told", String, DEFAULT)
    recording = record(publisher, backlog=1 << 20)
    sent = 300
    for number in range(sent):
        publisher.publish(String(data=f"{number:05}" * 2000))
    # Nothing is written meanwhile. The last one has arrived when all are accounted for.
    topic = recording.recorder.topics["/told"]
    recording.until(lambda: topic.written + topic.dropped + topic.gaps.lost == sent)
    # When there is room again, messages are recorded again.
    publisher.publish(String(data="last"))
    recording.until(lambda: topic.written + topic.dropped + topic.gaps.lost == sent + 1)
    recording.finish()
    read = by_rosbags(tmp_path / "bag")
    assert read[-1].data == String(data="last").to_cdr()
    assert len(read) == topic.written == sent + 1 - topic.dropped
    assert topic.dropped > 100
    assert metadata_of(tmp_path / "bag" / "bag_0.mcap", "mjplug_end")["dropped"] == f'{{"/told": {topic.dropped}}}'


def test_messages_that_were_lost_on_the_way_are_counted_by_their_numbers(publishing, record, tmp_path):
    publishing.publisher("/told", String, DEFAULT)
    recording = record()
    cdr = String(data="x").to_cdr()
    for number in (1, 2, 5, 6, 10):
        attachment = struct.pack("<qqB16sqI", number, 10, 16, b"g" * 16, number, 0)
        recording.client.session.put(
            "told", cdr, attachment=attachment, congestion_control=zenoh.CongestionControl.BLOCK
        )
    recording.arrived(5)
    recording.finish()
    assert recording.recorder.topics["/told"].gaps.lost == 5
    assert metadata_of(tmp_path / "bag" / "bag_0.mcap", "mjplug_end")["lost"] == '{"/told": 5}'


def test_a_publisher_without_attachments_is_recorded_at_the_time_of_the_clock(publishing, record, tmp_path):
    clock = publishing.publisher("/clock", Clock, CLOCK)
    publishing.publisher("/told", String, DEFAULT)
    recording = record(clock, selection=Selection(names=frozenset({"/told"})))
    publishing.at(42.0)
    clock.publish(Clock())
    assert recording.recorder.wait_for_time(60.0)
    recording.client.session.put("told", String(data="x").to_cdr(), congestion_control=zenoh.CongestionControl.BLOCK)
    recording.arrived(1)
    recording.finish()
    # The clock itself is not selected.
    assert [(r.topic, r.log_time) for r in by_rosbags(tmp_path / "bag")] == [("/told", 42 * 10**9)]


def test_the_past_of_a_latched_topic_is_at_the_beginning_of_the_recording(publishing, record, tmp_path):
    static, told = publishing.publisher("/static", String, LATCHED), publishing.publisher("/told", String, DEFAULT)
    static.publish(String(data="long ago"))
    recording = record(told)
    publishing.at(1000.0)
    told.publish(String(data="x"))
    recording.arrived(2)
    told.publish(String(data="x"))
    recording.arrived(3)
    recording.finish()
    times = {r.log_time for r in by_rosbags(tmp_path / "bag")}
    assert times <= {0, 1000 * 10**9}


def test_commands_in_every_form_are_recorded_as_cdr(publishing, record, tmp_path):
    topic = Topic("/cmd_vel", Twist, DEFAULT)
    publishing.network.open_subscription(topic, lambda message: None)
    recording = record()
    recording.until(lambda: "/cmd_vel" in recording.recorder.topics)
    twist = Twist(linear=Vector3(x=0.5))
    session, ros2 = recording.client.session, RosKey(topic)
    block = zenoh.CongestionControl.BLOCK
    session.put("cmd_vel", twist.to_cdr(), congestion_control=block)
    session.put("cmd_vel", twist.to_json(), encoding=zenoh.Encoding.APPLICATION_JSON, congestion_control=block)
    session.put("cmd_vel/@json", b'{"linear": {"x": 0.5}}', congestion_control=block)
    session.put(ros2.key, twist.to_cdr(), attachment=ros2.attachment, congestion_control=block)
    session.put("cmd_vel", b"neither", congestion_control=block)
    recording.arrived(4)
    recording.until(lambda: recording.recorder.total("unreadable") == 1)
    recording.finish()
    assert [r.data for r in by_rosbags(tmp_path / "bag")] == [twist.to_cdr()] * 4


class RosKey:
    def __init__(self, topic):
        self.key = RosSettings().data_key(topic.name, topic.type)
        self.attachment = struct.pack("<qqB16s", 1, 10, 16, b"r" * 16)


def test_wall_time_is_the_axis_if_it_is_wanted(publishing, record, tmp_path):
    publisher = publishing.publisher("/told", String, DEFAULT)
    recording = record(publisher, clock="wall")
    began = time.time_ns()
    publisher.publish(String(data="x"))
    recording.arrived(1)
    recording.finish()
    (read,) = by_rosbags(tmp_path / "bag")
    assert began - 10**8 <= read.log_time <= time.time_ns()


def test_topics_that_appear_later_are_recorded_and_those_that_never_do_are_named(publishing, record, tmp_path):
    recording = record(selection=Selection(names=frozenset({"/told", "/tolt"})))
    assert recording.recorder.missing() == ["/told", "/tolt"]
    publisher = publishing.publisher("/told", String, DEFAULT)
    recording.until(lambda: publisher.writers[0].matched)
    publisher.publish(String(data="x"))
    recording.arrived(1)
    recording.finish()
    assert recording.recorder.missing() == ["/tolt"]
    assert len(by_rosbags(tmp_path / "bag")) == 1


def test_a_bag_without_messages_is_a_bag(publishing, record, tmp_path):
    publishing.publisher("/told", String, DEFAULT)
    recording = record()
    recording.finish()
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (about["message_count"], about["files"]) == (0, [])


def test_a_name_that_is_taken_and_a_folder_that_cannot_be_made_are_refused(publishing, record, tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(BagError, match=r"taken already exists; choose another name with --output"):
        record(folder="taken")
    (tmp_path / "file").touch()
    with pytest.raises(BagError, match=r"cannot create .*file/bag: Not a directory"):
        record(folder="file/bag")
