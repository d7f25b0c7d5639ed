"""Bytes that are no request: refused with a reason, on every key, without effect."""

import json
import random
import struct

import zenoh
from cli.attack import VALID, garbage, refused
from cli.client import JSON
from refusals import refusal_in

from mjplug_schemas.registry import find

CDR = zenoh.Encoding.APPLICATION_CDR


def keys(world, kind, name="key"):
    return [entry[name] for entry in world.client.ask("mjplug/interfaces")[kind]]


def test_garbage_is_refused_by_every_service(target):
    services = keys(target, "services")
    assert set(VALID) < set(services)
    pending = [
        target.client.send(key, payload, encoding)
        for key in services
        for payload in garbage()
        for encoding in (None, JSON, CDR)
    ]
    for one in pending:
        refused(one)


def test_garbage_on_every_topic_is_dropped(target):
    before = target.state()["twists"]
    for key in keys(target, "topics") + keys(target, "topics", "json_key"):
        for payload in garbage():
            for encoding in (None, JSON, CDR):
                target.client.put(key, payload, encoding)
        target.client.session.delete(key)
    assert target.state()["twists"] == before
    target.client.put("probe/twist", '{"linear": {"x": 0.5}}', JSON)
    assert (target.state()["twists"], target.state()["last_twist_x"]) == (before + 1, 0.5)


def test_garbage_from_ros_2_nodes_gets_an_error_response(target):
    node = struct.pack("<qqB", 1, 1, 16) + bytes(16)
    for entry in target.client.ask("mjplug/interfaces")["services"]:
        response_type = find(entry["type"]).Response
        pending = [target.client.send(entry["ros2_key"], payload, None, node) for payload in garbage()]
        for one in pending:
            answer = one.answer()
            # A node that gets an error reply waits for ever.
            assert answer.ok
            response = response_type.from_cdr(answer.payload)
            reason = refusal_in(response)
            # Where a response cannot report a failure, the node gets an empty one.
            assert response == response_type() if reason is None else 5 < len(reason) < 5000


def test_queries_that_no_ros_2_node_would_send_are_refused(target):
    attachments = [None, b"", b"\0", bytes(16), bytes(32), bytes(33), b"\xff" * 33, b"\xff" * 34, bytes(1_000_000)]
    for entry in target.client.ask("mjplug/interfaces")["services"]:
        request = find(entry["type"]).Request.from_json(json.dumps(VALID.get(entry["key"], {}))).to_cdr()
        for attachment in attachments:
            answer = target.client.send(entry["ros2_key"], request[:-1] + b"\xff" * 10, None, attachment).answer()
            response = find(entry["type"]).Response.from_cdr(answer.payload) if answer.ok else None
            assert getattr(response, "success", False) is False


def test_garbage_of_ros_2_nodes_on_topics_is_dropped(target):
    before = target.state()["twists"]
    for key in keys(target, "topics", "ros2_key"):
        for payload in garbage():
            for attachment in (None, b"\xff" * 33, struct.pack("<qqB", 1, 1, 16) + bytes(16)):
                target.client.put(key, payload, None, attachment)
    assert target.state()["twists"] == before


def test_ten_megabytes_are_refused_unread(target):
    megabytes = random.Random(1).randbytes(10_000_000)
    for key in keys(target, "services"):
        sentence = refused(target.client.send(key, megabytes, CDR))
        assert sentence == "the payload has 10000000 bytes; at most 1048576 are accepted (zenoh.max_payload_bytes)"
    target.client.put("probe/twist", megabytes, CDR)


def test_a_megabyte_of_wrenches_is_refused_whole(target):
    many = b'{"wrenches": {"external_wrenches": [' + b",".join([b"{}"] * 340_000) + b"]}}"
    sentence = refused(target.client.send("external_wrench/apply_wrench", many, JSON, timeout=60.0))
    assert sentence == "the JSON has 1020038 bytes; at most 65536 are accepted (zenoh.max_json_bytes), send CDR instead"
    most = b'{"wrenches": {"external_wrenches": [' + b",".join([b"{}"] * 1_022) + b"]}}"
    assert "nothing was applied" in refused(
        target.client.send("external_wrench/apply_wrench", most, JSON, timeout=60.0)
    )


def test_other_encodings_and_other_types_are_refused(target):
    for key in keys(target, "services"):
        for encoding in (zenoh.Encoding.IMAGE_PNG, CDR.with_schema("std_msgs/msg/String"), zenoh.Encoding("@/%;;")):
            assert refused(target.client.send(key, b"{}", encoding)).startswith("the encoding ")
