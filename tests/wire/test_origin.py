"""The attachments of messages on plain keys, and the count of lost messages."""

import struct
import threading
import time

import pytest
from waits import TIMEOUT
from wire.conftest import ANY_PORT
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from mjplug.contracts.transport import DEFAULT, LATCHED, Topic
from mjplug.wire.network import open_network
from mjplug.wire.origin import Gaps, Origin, decode, no_time
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.session import SessionSettings, join
from mjplug_schemas.std_msgs import String


class World:
    time_ns, epoch = 0, 0


@pytest.fixture
def world():
    return World()


@pytest.fixture
def network(opened, world):
    settings = SessionSettings(listen=ANY_PORT)
    return opened(open_network(settings, "/mjplug", now=lambda: (world.time_ns, world.epoch)))


def unpacked(sample):
    """Sequence number, wall time, length of the gid, gid, simulated time and epoch, as any client reads them."""
    return struct.unpack("<qqB16sqI", bytes(sample.attachment))


def matched_publisher(network, client, qos, *keys):
    matched = threading.Event()
    queues = [client.listen(key) for key in keys]
    publisher = network.open_publisher(Topic("/told", String, qos), matched.set)
    client.settle()
    for key in keys:
        network._refresh(key)
    return publisher, queues


def test_each_key_counts_its_messages_and_states_both_times_epoch_and_source(network, client, world):
    publisher, (cdr, json) = matched_publisher(network, client, DEFAULT, "told", "told/@json")
    began = time.time_ns()
    for world.time_ns, world.epoch in ((0, 0), (2_000_000, 0), (2_000_000, 1), (2**62, 2**32 - 1)):
        publisher.publish(String(data="x"))
    gids = set()
    for samples in (cdr, json):
        read = [unpacked(samples.get(timeout=TIMEOUT)) for _ in range(4)]
        assert [row[0] for row in read] == [1, 2, 3, 4]
        assert [(row[4], row[5]) for row in read] == [(0, 0), (2_000_000, 0), (2_000_000, 1), (2**62, 2**32 - 1)]
        assert {row[2] for row in read} == {16}
        assert began <= read[0][1] <= read[3][1] <= time.time_ns()
        gids |= {row[3] for row in read}
    # Two publishers in Zenoh's sense, of one server.
    assert len(gids) == 2
    assert len({gid[:8] for gid in gids}) == 1


def test_the_first_33_bytes_are_those_of_rmw_zenoh(network, client):
    publisher, (cdr,) = matched_publisher(network, client, DEFAULT, "told")
    publisher.publish(String(data="x"))
    raw = bytes(cdr.get(timeout=TIMEOUT).attachment)
    theirs, ours = Attachment.from_bytes(raw[:33]), decode(raw)
    assert (theirs.sequence_number, theirs.source_timestamp, theirs.gid) == (
        ours.sequence_number, ours.source_timestamp, ours.gid,
    )  # fmt: skip


def test_a_message_that_nobody_gets_has_no_number(network, client):
    publisher = network.open_publisher(Topic("/told", String, DEFAULT))
    publisher.publish(String(data="to nobody"))
    samples = client.listen("told")
    client.settle()
    network._refresh("told")
    publisher.publish(String(data="x"))
    assert unpacked(samples.get(timeout=TIMEOUT))[0] == 1


def test_late_subscribers_of_a_latched_topic_get_the_original_attachment(network, client, world):
    publisher = network.open_publisher(Topic("/told", String, LATCHED))
    world.time_ns, world.epoch = 5, 1
    publisher.publish(String(data="x"))
    world.time_ns, world.epoch = 99, 9
    received = threading.Event()
    samples = []

    def take(sample):
        samples.append(sample)
        received.set()

    kept = declare_advanced_subscriber(client.session, "told", take, history=HistoryConfig(detect_late_publishers=True))
    assert received.wait(TIMEOUT)
    (reply,) = client.session.get("told", timeout=TIMEOUT)
    assert unpacked(samples[0]) == unpacked(reply.ok)
    assert unpacked(samples[0])[0] == 1
    assert unpacked(samples[0])[4:] == (5, 1)
    kept.undeclare()


def test_a_worker_process_publishes_as_the_same_server_but_with_numbers_of_its_own(network, client, opened):
    tenant = opened(join(SessionSettings(listen=ANY_PORT), network.session.endpoints))
    own, (cdr,) = matched_publisher(network, client, DEFAULT, "told")
    own.publish(String(data="x"))
    first = decode(bytes(cdr.get(timeout=TIMEOUT).attachment))
    seen = [first]
    # The second one stands for a worker that was started again.
    for now in ((7, 3), (8, 3)):
        matched = threading.Event()
        publisher = own.remote_spec().open(tenant, matched.set, lambda now=now: now)
        assert matched.wait(TIMEOUT)
        publisher.publish(String(data="x"))
        seen.append(decode(bytes(cdr.get(timeout=TIMEOUT).attachment)))
    assert [(origin.sequence_number, origin.time_ns, origin.epoch) for origin in seen] == [
        (1, 0, 0),
        (1, 7, 3),
        (1, 8, 3),
    ]
    assert len({origin.gid for origin in seen}) == 3
    assert len({origin.host for origin in seen}) == 1


def packed(number, simulated=0, epoch=0, gid=b"g" * 16):
    return struct.pack("<qqB16sqI", number, 10, 16, gid, simulated, epoch)


def test_attachments_of_other_formats_are_ignored():
    assert decode(b"") is None
    assert decode(b"rqh" + bytes(17)) is None
    assert decode(packed(1)[:44]) is None
    assert decode(packed(1)[:16] + b"\x08" + packed(1)[17:]) is None
    assert decode(packed(7, 8, 9)) == Origin(7, 10, b"g" * 16, 8, 9)
    # A later version may append to it.
    assert decode(packed(7, 8, 9) + b"more") == Origin(7, 10, b"g" * 16, 8, 9)
    # rmw_zenoh's, and that of a client.
    assert decode(packed(7)[:33]) == Origin(7, 10, b"g" * 16)
    assert decode(packed(7, no_time()[0])) == Origin(7, 10, b"g" * 16)


def test_gaps_are_counted_for_each_publisher():
    gaps = Gaps()

    def seen(number, gid=b"a" * 16):
        return gaps.count(Origin(number, 0, gid))

    assert gaps.count(None) == 0
    assert not gaps.known
    # Nobody can know what was sent before the first one.
    assert seen(5) == 0
    assert (gaps.lost, gaps.known) == (0, True)
    assert [seen(n) for n in (6, 7, 10, 11)] == [0, 0, 2, 0]
    # From the history, or twice.
    assert [seen(n) for n in (6, 11, 12)] == [0, 0, 0]
    assert [seen(n, b"b" * 16) for n in (1, 2, 4)] == [0, 0, 1]
    assert seen(14) == 1
    assert gaps.lost == 4


def test_invented_publishers_do_not_fill_the_memory():
    gaps = Gaps()
    for number in range(5000):
        gaps.count(Origin(1, 0, number.to_bytes(16, "big")))
    assert len(gaps._last) == 1024
    assert gaps.lost == 0
