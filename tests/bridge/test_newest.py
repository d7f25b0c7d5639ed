"""Topics whose readers in ROS are slower than the messages arrive."""

import threading

import pytest
import zenoh
from waits import TIMEOUT

from mjplug_schemas.std_msgs import String


class SlowReader:
    """Handles a message only when the test allows it."""

    def __init__(self):
        self.handled = []
        self.entered = threading.Semaphore(0)
        self.leave = threading.Semaphore(0)

    def handle(self, message):
        self.handled.append(message)
        self.entered.release()
        assert self.leave.acquire(timeout=TIMEOUT)


@pytest.mark.parametrize(("depth", "kept"), [(1, [99]), (3, [97, 98, 99]), (0, [99]), (1000, list(range(1, 100)))])
def test_of_the_messages_that_wait_the_newest_are_kept(depth, kept):
    from mjplug_bridge_ros2.newest import Newest

    reader = SlowReader()
    newest = Newest(reader.handle, depth)
    newest.add(0)
    assert reader.entered.acquire(timeout=TIMEOUT)
    for number in range(1, 100):
        newest.add(number)
    for _ in kept:
        reader.leave.release()
        assert reader.entered.acquire(timeout=TIMEOUT)
    reader.leave.release()
    assert reader.handled == [0, *kept]
    newest.add(100)
    assert reader.entered.acquire(timeout=TIMEOUT)
    reader.leave.release()
    newest.close()
    assert reader.handled[-1] == 100


def test_nothing_is_handled_after_the_end():
    from mjplug_bridge_ros2.newest import Newest

    reader = SlowReader()
    newest = Newest(reader.handle, 10)
    for number in range(5):
        newest.add(number)
    assert reader.entered.acquire(timeout=TIMEOUT)
    newest.close()
    newest.close()
    newest.add(5)
    reader.leave.release()
    assert not reader.entered.acquire(timeout=0.2)
    assert reader.handled == [0]


class FakeNode:
    """Makes one publisher, itself, whose `publish` is the test's."""

    def __init__(self, publish):
        self.publish = publish
        self.errors = []

    def create_publisher(self, *arguments, **options):
        return self

    def get_subscription_count(self):
        return 1

    def get_logger(self):
        return self

    def error(self, sentence):
        self.errors.append(sentence)

    def destroy_publisher(self, publisher):
        pass


@pytest.fixture
def to_ros(monkeypatch):
    """Creates the ROS side of a topic on a separate Zenoh session; returns a function that puts a message on it."""
    import rclpy

    from mjplug_bridge_ros2.listing import QoS, TopicEntry
    from mjplug_bridge_ros2.topics import ToRos

    monkeypatch.setattr(rclpy, "ok", lambda: True)
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    session = zenoh.open(config)
    topics = []

    def make(node, depth):
        entry = TopicEntry("/words", "words", String.TYPE, "", True, QoS(depth, reliable=True, latched=False))
        topics.append(ToRos(node, session, entry, "/words", String))
        return lambda word: session.put("words", String(data=word).to_cdr(), encoding="application/cdr")

    yield make
    for topic in topics:
        topic.close("the test is over")
    session.close()


def test_a_topic_whose_publisher_is_slow_drops_its_oldest_messages(to_ros):
    reader = SlowReader()
    put = to_ros(FakeNode(reader.handle), 2)
    put("first")
    assert reader.entered.acquire(timeout=TIMEOUT)
    for number in range(50):
        put(str(number))
    for _ in range(2):
        reader.leave.release()
        assert reader.entered.acquire(timeout=TIMEOUT)
    reader.leave.release()
    assert [String.from_cdr(payload).data for payload in reader.handled] == ["first", "48", "49"]


def test_a_message_that_ros_refuses_does_not_end_its_topic(to_ros):
    published = []
    came = threading.Semaphore(0)

    def publish(payload):
        published.append(String.from_cdr(payload).data)
        came.release()
        if published[-1] == "wrong":
            raise RuntimeError("Failed to publish")

    node = FakeNode(publish)
    put = to_ros(node, 10)
    for word in ("wrong", "right", "wrong", "right"):
        put(word)
        assert came.acquire(timeout=TIMEOUT)
    assert published == ["wrong", "right", "wrong", "right"]
    (sentence,) = node.errors
    assert sentence.startswith("a message on the key words could not be published in ROS")
    assert ": Failed to publish (" in sentence
