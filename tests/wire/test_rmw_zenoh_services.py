"""Services on the keys of rmw_zenoh, called by bare Zenoh peers that check bytes."""

import queue
import time

import pytest
import zenoh
from waits import TIMEOUT
from wire.ros_peer import TRIGGER_KEY, WHO, WRENCH_KEY, request
from zenoh.ext import Int64, z_serialize

from mjplug.contracts.transport import ServiceName
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrench, ExternalWrenchArray
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.std_srvs import Empty, SetBool, Trigger


@pytest.fixture
def network(new_ros_network):
    return new_ros_network()


def wrench():
    return ExternalWrench(
        wrench=WrenchStamped(header=Header(frame_id="pelvis"), wrench=Wrench(force=Vector3(x=10.0))),
        duration=Duration(sec=1),
        ramp_down_duration=Duration(nanosec=500_000_000),
    )


WRENCH_REQUEST = bytes.fromhex(
    "00010000 01000000"
    + "00" * 8
    + "01000000 00 000000"
    + "00" * 8
    + "07000000 70656c76697300 00"
    + "0000000000002440"
    + "00" * 40
    + "00" * 24
    + "0100000000000000 00000000 0065cd1d"
)


def test_a_deferred_response_has_the_bytes_of_the_worked_example(network, client):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), calls.put)
    client.settle()
    replies = queue.SimpleQueue()
    client.session.get(
        WRENCH_KEY,
        replies.put,
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        payload=WRENCH_REQUEST,
        attachment=Attachment(5, 1234, WHO).to_bytes(),
        timeout=TIMEOUT,
    )
    call = calls.get(timeout=TIMEOUT)
    assert len(WRENCH_REQUEST) == 132
    assert call.request == ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=(wrench(),)))
    before = time.time_ns()
    call.respond(ApplyExternalWrench.Response(success=True, message="ok"))
    sample = replies.get(timeout=TIMEOUT).ok
    assert str(sample.key_expr) == WRENCH_KEY
    assert bytes(sample.payload) == bytes.fromhex("00010000 01 000000 03000000 6f6b00")
    attachment = bytes(sample.attachment)
    assert attachment[:8] == (5).to_bytes(8, "little")
    assert before <= int.from_bytes(attachment[8:16], "little") <= time.time_ns()
    assert attachment[16:] == b"\x10" + WHO


@pytest.mark.parametrize("type_hash", ["TypeHashNotSupported", RosSettings().type_hash(Trigger)])
def test_requests_with_our_hash_and_of_humble_are_answered(network, client, type_hash):
    network.open_service(
        ServiceName("/trigger", Trigger), lambda call: call.respond(Trigger.Response(success=True, message="done"))
    )
    client.settle()
    key = f"0/trigger/std_srvs::srv::dds_::Trigger_/{type_hash}"
    sample = request(client, key, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes()).ok
    assert str(sample.key_expr) == key
    assert Trigger.Response.from_cdr(bytes(sample.payload)).message == "done"


@pytest.mark.parametrize("distro", ["jazzy", "humble"])
def test_a_request_of_another_definition_is_refused_and_not_decoded(new_ros_network, client_of, distro):
    network = new_ros_network(distro=distro)
    client = client_of(network.session.endpoint)
    calls = []
    network.open_service(ServiceName("/set", SetBool), calls.append)
    foreign = "RIHS01_" + "0" * 64
    attachment = Attachment(7, 1, WHO)
    key = f"0/set/std_srvs::srv::dds_::SetBool_/{foreign}"
    client.settle()
    reply = request(client, key, SetBool.Request(data=True).to_cdr(), attachment.to_bytes())
    response = SetBool.Response.from_cdr(bytes(reply.ok.payload))
    ours = RosSettings().type_hash(SetBool)
    assert response == SetBool.Response(
        success=False,
        message="the sender uses another definition of std_srvs/srv/SetBool: "
        f"its type hash is {foreign}, the server's is {ours}",
    )
    assert Attachment.from_bytes(bytes(reply.ok.attachment)).sequence_number == 7
    assert calls == []
    assert network.refused()["/set"] == 1


def test_a_client_that_leaves_the_hash_open_gets_ours(network, client):
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.respond(Trigger.Response(success=True)))
    client.settle()
    key = RosSettings().any_hash_key("/trigger", Trigger)
    sample = request(client, key, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes()).ok
    assert str(sample.key_expr) == TRIGGER_KEY


@pytest.mark.parametrize("payload", [b"\0\1\0\0\7", b"{}", b"", b"\0\1", bytes(2 << 20)])
def test_a_request_that_cannot_be_read_gets_an_error_response(network, client, payload):
    network.open_service(ServiceName("/switch", SetBool), lambda call: call.respond(SetBool.Response(success=True)))
    client.settle()
    key = RosSettings().data_key("/switch", SetBool)
    reply = request(client, key, payload, Attachment(9, 1, WHO).to_bytes())
    if payload:
        response = SetBool.Response.from_cdr(bytes(reply.ok.payload))
        assert response.success is False
        assert "SetBool_Request" in response.message or "bytes" in response.message
    else:
        # A request without fields may have no payload; its fields have their default values.
        assert SetBool.Response.from_cdr(bytes(reply.ok.payload)).success is True
    assert Attachment.from_bytes(bytes(reply.ok.attachment)).sequence_number == 9


def test_a_refusal_is_a_response_even_if_the_type_has_no_field_for_it(network, client):
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.refuse("not now"))
    network.open_service(ServiceName("/empty", Empty), lambda call: call.refuse("not now"))
    client.settle()
    who = Attachment(1, 1, WHO).to_bytes()
    reply = request(client, TRIGGER_KEY, b"\0\1\0\0\0", who)
    assert Trigger.Response.from_cdr(bytes(reply.ok.payload)) == Trigger.Response(success=False, message="not now")
    reply = request(client, RosSettings().data_key("/empty", Empty), b"\0\1\0\0\0", who)
    assert bytes(reply.ok.payload) == b"\0\1\0\0\0"


def test_a_flood_of_refusals_without_a_message_field_does_not_fill_the_log(network, client, caplog):
    network.open_service(ServiceName("/empty", Empty), lambda call: call.refuse("not now"))
    client.settle()
    for number in range(25):
        request(client, RosSettings().data_key("/empty", Empty), b"\0\1\0\0\0", Attachment(number, 1, WHO).to_bytes())
    assert caplog.messages == [
        f"a client got an empty response ({count} so far): std_srvs/srv/Empty has no field for a failure: not now"
        for count in (1, 10)
    ]


def test_requests_that_wait_are_answered_before_the_server_leaves(network, client):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    client.settle()
    replies = queue.SimpleQueue()
    client.session.get(
        TRIGGER_KEY, replies.put, payload=b"\0\1\0\0\0", attachment=Attachment(1, 1, WHO).to_bytes(), timeout=TIMEOUT
    )
    calls.get(timeout=TIMEOUT)
    network.close("the server is stopping")
    sample = replies.get(timeout=TIMEOUT).ok
    assert Trigger.Response.from_cdr(bytes(sample.payload)).message == "the server is stopping"


@pytest.mark.parametrize(
    ("key", "attachment", "sentence"),
    [
        (TRIGGER_KEY, None, "the attachment has 0 bytes"),
        ("0/trigger/**", None, f"{TRIGGER_KEY} is a service; query exactly this key to call it"),
        ("0/trigger/*/*", None, f"{TRIGGER_KEY} is a service; query exactly this key to call it"),
    ],
)
def test_a_query_that_is_no_request_of_a_node_calls_nothing(network, client, key, attachment, sentence):
    calls = []
    network.open_service(ServiceName("/trigger", Trigger), calls.append)
    client.settle()
    reply = request(client, key, b"\0\1\0\0\0", attachment, zenoh.QueryTarget.ALL)
    assert bytes(reply.err.payload).decode().startswith(sentence)
    assert calls == []


def with_names(number, stamp, sender):
    """The attachment of rmw_zenoh before 0.1.2, 0.2.4 and 0.6.0: each value after its name."""
    values = ("sequence_number", Int64(number), "source_timestamp", Int64(stamp), "source_gid", sender)
    return bytes(z_serialize(values))


@pytest.mark.parametrize("attachment", [with_names(7, 1234, WHO), b"sequence_number", bytes(32), bytes(50)])
def test_a_node_whose_attachments_are_others_gets_an_error_and_does_not_wait(network, client, attachment):
    calls = []
    network.open_service(ServiceName("/trigger", Trigger), calls.append)
    network.open_service(ServiceName("/empty", Empty), calls.append)
    client.settle()
    reply = request(client, TRIGGER_KEY, b"\0\1\0\0\0", attachment)
    response = Trigger.Response.from_cdr(bytes(reply.ok.payload))
    assert response.success is False
    assert response.message.startswith(f"the attachment has {len(attachment)} bytes")
    # It finds its own number and sender where it wrote them.
    assert bytes(reply.ok.attachment) == attachment
    reply = request(client, RosSettings().data_key("/empty", Empty), b"\0\1\0\0\0", attachment)
    assert bytes(reply.ok.payload) == b"\0\1\0\0\0"
    assert calls == []
