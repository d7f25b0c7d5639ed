"""What a client learns about lost messages, ages and the instants to which messages belong."""

import struct
import time

import pytest
import zenoh

from mjplug_schemas.std_msgs import String

TIMEOUT = 60.0


def attachment(number, simulated=-1, epoch=0, gid=b"g" * 16):
    return struct.pack("<qqB16sqI", number, time.time_ns(), 16, gid, simulated, epoch)


@pytest.fixture
def put(client):
    """Publishes on /told as another program, with or without an attachment."""
    cdr = String(data="x").to_cdr()
    block = zenoh.CongestionControl.BLOCK

    def put(attached=None):
        client.session.put("told", cdr, attachment=attached, congestion_control=block)

    return put


def test_the_attachment_of_the_clock_contains_the_time_in_the_message(client):
    clocks = client.subscribe("/clock")
    client.subscribe("~/epoch").next(TIMEOUT)
    for _ in range(20):
        message = clocks.next(TIMEOUT)
        origin = clocks.info.origin
        assert origin.time_ns == message.clock.sec * 10**9 + message.clock.nanosec
        assert origin.source_timestamp <= clocks.info.received_timestamp
        assert 0.0 <= clocks.info.age < TIMEOUT
    assert clocks.lost == 0


def test_the_epoch_in_attachments_changes_with_a_reset(client):
    epochs, clocks = client.subscribe("~/epoch"), client.subscribe("/clock")
    before = epochs.next(TIMEOUT).data
    clocks.next(TIMEOUT)
    client.call("~/reset_world")
    assert epochs.next(TIMEOUT).data == before + 1
    assert epochs.info.origin.epoch == before + 1
    until = time.monotonic() + TIMEOUT
    while clocks.info.origin.epoch == before:
        assert time.monotonic() < until
        clocks.next(TIMEOUT)
    assert clocks.info.origin.epoch == before + 1


def test_missing_numbers_are_lost_messages(client, put):
    messages = client.subscribe("/told", String)
    for number in (1, 2, 5, 6, 6, 9):
        put(attachment(number))
    lost = []
    for _ in range(6):
        messages.next(TIMEOUT)
        lost.append(messages.info.lost)
    assert lost == [0, 0, 2, 0, 0, 2]
    assert messages.lost == 4
    assert messages.info.origin.time_ns is None


def test_messages_of_a_publisher_without_attachments_are_read_as_before(client, put):
    messages = client.subscribe("/told", String)
    put()
    put(b"of somebody else")
    for _ in range(2):
        assert messages.next(TIMEOUT) == String(data="x")
        assert (messages.info.origin, messages.info.age, messages.info.lost) == (None, None, 0)
    assert messages.lost == 0


def test_messages_of_a_client_have_numbers_but_no_simulated_time(client):
    messages = client.subscribe("/told", String)
    publisher = client.publisher("/told", String)
    assert publisher.wait_for_subscriber(TIMEOUT)
    origins = []
    for _ in range(3):
        publisher.publish(String(data="x"))
        messages.next(TIMEOUT)
        origins.append(messages.info.origin)
    assert [origin.sequence_number for origin in origins] == [1, 2, 3]
    assert {origin.time_ns for origin in origins} == {None}
    assert len({origin.gid for origin in origins}) == 1
