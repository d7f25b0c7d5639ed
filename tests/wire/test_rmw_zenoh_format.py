"""The format of rmw_zenoh, against vectors that its own token parser and hash gave."""

import json
import time
from pathlib import Path

import pytest
import zenoh
from zenoh.ext import Int64, z_serialize

from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED, QoS
from mjplug.wire.rmw_zenoh.attachment import Attachment, Attachments
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.qos import SERVICE, qos_chunk
from mjplug.wire.rmw_zenoh.tokens import Endpoint, Node, endpoints_of, gid, read_endpoint
from mjplug_schemas import registry
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String

VECTORS = json.loads((Path(__file__).parent / "vectors" / "rmw_zenoh_tokens.json").read_text())
HASHES = json.loads((Path(__file__).parents[1] / "schemas" / "vectors" / "rihs01.json").read_text())

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
WRENCH_HASH = "RIHS01_3ced9bbef0a495b94e0ebe367964b04cd15ff52376462634600793fb05026982"
TF_HASH = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
PARAMETERS_HASH = "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"

MJPLUG = Node(0, "9a0e76272d88cc11f8fb008635cab1a3", 0, "", "mjplug")
CAM = Node(7, "9a0e76272d88cc11f8fb008635cab1a3", 0, "/robot1/sensors", "cam", enclave="/secure/encl")
JAZZY = RosSettings(0, "jazzy")


@pytest.mark.parametrize("vector", VECTORS, ids=range(len(VECTORS)))
def test_the_gid_is_the_one_that_nodes_compute_from_the_token(vector):
    assert gid(vector["token"]).hex() == vector["gid"]


@pytest.mark.parametrize(
    ("index", "token"),
    [
        (0, MJPLUG.token),
        (
            1,
            MJPLUG.endpoint_token(
                1, "MP", "/mujoco_heartbeat", String.TYPE, JAZZY.type_hash(String), qos_chunk(DEFAULT)
            ),
        ),
        (2, MJPLUG.endpoint_token(2, "MP", "/tf_static", "tf2_msgs/msg/TFMessage", TF_HASH, qos_chunk(LATCHED))),
        (3, MJPLUG.endpoint_token(3, "MS", "/clock", Clock.TYPE, JAZZY.type_hash(Clock), qos_chunk(CLOCK))),
        (
            4,
            MJPLUG.endpoint_token(
                4,
                "SS",
                "/external_wrench/apply_wrench",
                ApplyExternalWrench.TYPE,
                JAZZY.type_hash(ApplyExternalWrench),
                qos_chunk(SERVICE),
            ),
        ),
        (
            5,
            CAM.endpoint_token(
                1,
                "SC",
                "/robot1/sensors/cam/get_parameters",
                "rcl_interfaces/srv/GetParameters",
                PARAMETERS_HASH,
                qos_chunk(SERVICE, "keep_all"),
            ),
        ),
    ],
)
def test_tokens_are_those_that_rmw_zenoh_reads(index, token):
    assert token == VECTORS[index]["token"]


@pytest.mark.parametrize(
    ("qos", "chunk"),
    [
        (QoS(depth=10), "::,10:,:,:,,"),
        (QoS(depth=5, reliability="best_effort"), "2::,5:,:,:,,"),
        (QoS(depth=1, reliability="best_effort"), "2::,1:,:,:,,"),
        (QoS(depth=1, durability="transient_local"), ":1:,1:,:,:,,"),
        (QoS(depth=1000), "::,1000:,:,:,,"),
        (QoS(depth=42), "::,:,:,:,,"),
        (QoS(depth=3, reliability="best_effort", durability="transient_local"), "2:1:,3:,:,:,,"),
    ],
)
def test_the_quality_of_service_leaves_out_defaults(qos, chunk):
    assert qos_chunk(qos) == chunk


def test_keep_all_is_a_two():
    assert qos_chunk(QoS(depth=42), "keep_all") == "::2,:,:,:,,"


def test_data_keys_name_domain_name_type_and_hash():
    assert JAZZY.data_key("/mujoco_heartbeat", String) == (
        f"0/mujoco_heartbeat/std_msgs::msg::dds_::String_/{STRING_HASH}"
    )
    assert RosSettings(7).data_key("/external_wrench/apply_wrench", ApplyExternalWrench) == (
        "7/external_wrench/apply_wrench/mujoco_ros2_control_msgs::srv::dds_::ApplyExternalWrench_/" + WRENCH_HASH
    )
    assert JAZZY.any_hash_key("/a/b", String) == "0/a/b/std_msgs::msg::dds_::String_/*"


def test_humble_has_no_hashes():
    assert RosSettings(0, "humble").data_key("/a", String) == "0/a/std_msgs::msg::dds_::String_/TypeHashNotSupported"


@pytest.mark.parametrize("name", sorted(set(HASHES) & set(registry.all_types())))
def test_hashes_in_keys_are_those_of_rosidl(name):
    assert RosSettings(0).data_key("/a", registry.find(name)).endswith(f"/{HASHES[name]}")


def test_an_attachment_is_what_zenoh_serializes_and_can_be_taken_apart():
    token_gid = gid(VECTORS[1]["token"])
    attachment = Attachment(1, 1795231362523292416, token_gid)
    serialized = bytes(z_serialize((Int64(1), Int64(1795231362523292416), token_gid)))
    assert attachment.to_bytes() == serialized
    assert len(serialized) == 33
    assert Attachment.from_bytes(serialized) == attachment


def test_the_attachment_of_the_worked_example():
    sender = bytes.fromhex("319baa9673e232377d952331012dcb6d")
    assert Attachment(1, 1795231362523292416, sender).to_bytes() == bytes.fromhex(
        "0100000000000000 0063d7a469f1e918 10 319baa9673e232377d952331012dcb6d"
    )


def test_attachments_count_from_one_and_carry_the_time():
    attachments = Attachments(bytes(range(16)))
    before = time.time_ns()
    first, second = (Attachment.from_bytes(attachments.next()) for _ in range(2))
    assert (first.sequence_number, second.sequence_number) == (1, 2)
    assert before <= first.source_timestamp <= second.source_timestamp <= time.time_ns()
    assert first.gid == bytes(range(16))


def test_the_attachment_of_a_response_has_the_number_and_the_sender_of_its_request():
    request = Attachment(41, 7, bytes(range(16)))
    response = request.of_response()
    assert (response.sequence_number, response.gid) == (41, bytes(range(16)))
    assert abs(response.source_timestamp - time.time_ns()) < 1_000_000_000


@pytest.mark.parametrize("raw", [b"", bytes(33), bytes(16) + b"\x10" + bytes(15), bytes(16) + b"\x10" + bytes(17)])
def test_other_bytes_are_no_attachment(raw):
    with pytest.raises(ValueError, match=f"the attachment has {len(raw)} bytes"):
        Attachment.from_bytes(raw)


def test_the_tokens_of_an_endpoint_are_found_whatever_their_hash_and_read():
    wanted = zenoh.KeyExpr(endpoints_of(0, "MP", "/mujoco_heartbeat", String.TYPE))
    node = Node(0, "abc", 3, "/robot1/arm", "talker")
    token = node.endpoint_token(4, "MP", "/mujoco_heartbeat", String.TYPE, "RIHS01_x", qos_chunk(DEFAULT))
    assert wanted.intersects(token)
    assert wanted.intersects(f"{token}/backends:cpu:")
    assert read_endpoint(token) == Endpoint("abc", "/robot1/arm/talker", "RIHS01_x")
    assert read_endpoint(VECTORS[1]["token"]) == Endpoint(MJPLUG.zid, "/mjplug", STRING_HASH)
    for other in (
        node.endpoint_token(4, "MS", "/mujoco_heartbeat", String.TYPE, "RIHS01_x", qos_chunk(DEFAULT)),
        node.endpoint_token(4, "MP", "/heartbeat", String.TYPE, "RIHS01_x", qos_chunk(DEFAULT)),
        node.endpoint_token(4, "MP", "/mujoco_heartbeat", Clock.TYPE, "RIHS01_x", qos_chunk(DEFAULT)),
        node.token,
    ):
        assert not wanted.intersects(other)
