"""A network that publishes what a test wants, and a recorder that the test steps."""

import time
from contextlib import ExitStack

import pytest
from wire.conftest import ANY_PORT

from mjplug.bag.writer import BagWriter
from mjplug.client import connect
from mjplug.contracts.transport import Topic
from mjplug.recorder.recorder import Recorder
from mjplug.recorder.selection import Selection
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings

TIMEOUT = 60.0


class Publishing:
    """A server's network; `now` is its simulated time [ns] and its epoch."""

    def __init__(self, listen=ANY_PORT):
        self.now = (0, 0)
        self.network = open_network(SessionSettings(listen=listen), "/mjplug", ros2=RosSettings(), now=lambda: self.now)
        self.endpoint = self.network.session.endpoint

    def publisher(self, name, type, qos):
        return self.network.open_publisher(Topic(name, type, qos))

    def at(self, seconds, epoch=0):
        self.now = (round(seconds * 1e9), epoch)

    def close(self):
        self.network.close()


class Recording:
    """A recorder on its way."""

    def __init__(self, endpoint, folder, selection, clock, backlog, **options):
        self.client = connect(endpoint, timeout=TIMEOUT)
        self.notices = []
        self.bag = BagWriter(folder, custom={"clock": clock}, **options)
        self.recorder = Recorder(self.client.session, self.bag, selection, clock, backlog, self.notices.append)
        assert self.recorder.sources.known.wait(TIMEOUT)
        self._ended = False

    def until(self, condition):
        """Writes what arrives until a condition is true."""
        until = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < until, {name: vars_of(topic) for name, topic in self.recorder.topics.items()}
            self.recorder.turn(0.01)

    def arrived(self, count):
        """Writes until a number of messages is in the bag."""
        self.until(lambda: self.recorder.total("written") >= count)

    def finish(self):
        self._ended = True
        self.recorder.stop()
        self.recorder.finish()
        self.client.close()

    def close(self):
        if not self._ended:
            self.recorder.stop()
            self.client.close()


def vars_of(topic):
    return topic.written, topic.dropped, topic.gaps.lost


@pytest.fixture
def opened():
    with ExitStack() as stack:

        def keep(closeable):
            stack.callback(closeable.close)
            return closeable

        yield keep


@pytest.fixture
def publishing(opened):
    return opened(Publishing())


@pytest.fixture
def record(opened, publishing, tmp_path):
    """Begins to record everything that the network publishes, and waits until its publishers are matched."""

    def begin(*publishers, folder="bag", selection=None, clock="sim", backlog=1 << 29, **options):
        selection = selection or Selection(all=True)
        recording = opened(Recording(publishing.endpoint, tmp_path / folder, selection, clock, backlog, **options))
        recording.until(lambda: all(publisher.writers[0].matched for publisher in publishers))
        return recording

    return begin
