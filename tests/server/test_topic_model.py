"""A server whose model is the text on a topic, from Zenoh clients, from nodes of rmw_zenoh, and from another server."""

import json
import logging
import struct
import subprocess
import sys
import threading
from contextlib import ExitStack

import pytest
import typer
import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher

from mjplug.cli.received import receive_description
from mjplug.client import connect
from mjplug.config.problem import ConfigError
from mjplug.convert.load import load_model
from mjplug.errors import ModelError, WireError
from mjplug.server.open_server import open_server
from mjplug.wire.endpoints import with_free_port
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import String

ROS_KEY = (
    "0/robot_description/std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
)
OTHER_HASH = f"{ROS_KEY[:-4]}0000"
CDR = zenoh.Encoding("application/cdr;std_msgs/msg/String")

URDF = """<?xml version="1.0"?>
<robot name="pendulum">
  <link name="base_link"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="bob"><inertial><origin xyz="0 0 0.3"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>{visual}</link>
  <joint name="hinge" type="revolute"><parent link="base_link"/><child link="bob"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="3"/></joint>
</robot>"""
PLAIN = URDF.format(visual="")
MJCF = '<mujoco model="ball"><worldbody><body name="b"><joint name="j"/><geom size=".1"/></body></worldbody></mujoco>'
QUICK = {"model_timeout": 1.0}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def closing():
    with ExitStack() as stack:
        yield stack


def session(closing, mode, listen=(), connect=()):
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("listen/endpoints", json.dumps(listen))
    config.insert_json5("connect/endpoints", json.dumps(connect))
    config.insert_json5("scouting/multicast/enabled", "false")
    # Needed for the cache of an advanced publisher.
    config.insert_json5("timestamping/enabled", "true")
    opened = zenoh.open(config)
    closing.callback(opened.close)
    return opened


@pytest.fixture
def network(closing):
    """The endpoint of a router, and a client of it."""
    endpoint = with_free_port("tcp/127.0.0.1:0")
    session(closing, "router", [endpoint])
    return endpoint, session(closing, "client", connect=[endpoint])


def latched(closing, client, key, payload, attachment=None, encoding=None):
    """Publishes as rmw_zenoh does with transient local durability: with a cache, and an attachment."""
    publisher = declare_advanced_publisher(client, key, cache=CacheConfig(1), publisher_detection=True)
    publisher.put(payload, attachment=attachment, encoding=encoding)
    closing.callback(publisher.undeclare)
    return publisher


def attachment():
    return struct.pack("<qqB16s", 1, 1, 16, bytes(range(16)))


def served(endpoint, model="topic:/robot_description", **options):
    settings = {"node_name": "waiting", "model_timeout": 30.0} | options.pop("settings", {})
    return open_server(model, connect=endpoint, settings=settings, **options)


FORMS = {
    "zenoh, CDR": ("robot_description", String(data=PLAIN).to_cdr(), None, CDR),
    "zenoh, JSON": ("robot_description", String(data=PLAIN).to_json(), None, zenoh.Encoding.APPLICATION_JSON),
    "zenoh, the text itself": ("robot_description", b"\xef\xbb\xbf" + PLAIN.encode(), None, None),
    "rmw_zenoh": (ROS_KEY, String(data=PLAIN).to_cdr(), attachment(), None),
    "rmw_zenoh of Humble": (
        f"{ROS_KEY.rpartition('/')[0]}/TypeHashNotSupported", String(data=PLAIN).to_cdr(), attachment(), None
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_latched_description_is_converted_and_served(closing, network, form):
    endpoint, client = network
    key, payload, sent, encoding = form
    latched(closing, client, key, payload, sent, encoding)
    with served(endpoint, speed="max") as server, connect(server.endpoint, server="/waiting") as own:
        own.publish("/joint_commands", JointState(name=["hinge"], position=[0.3]))
        for message in own.subscribe("/joint_states", JointState):
            if abs(dict(zip(message.name, message.position, strict=True))["hinge"] - 0.3) < 1e-3:
                break
        # Its own description would be a second one on the same topic.
        assert "/robot_description" not in own.topics()


def test_a_description_that_is_only_given_to_queries_is_found(closing, network):
    endpoint, client = network

    def answer(query):
        with query:
            query.reply("robot_description", String(data=PLAIN).to_cdr(), encoding=CDR)

    queryable = client.declare_queryable("robot_description", answer)
    closing.callback(queryable.undeclare)
    with served(endpoint, run=False) as server:
        assert server.local is not None


def test_a_publisher_that_comes_later_connects_to_the_server_that_waits(closing, caplog):
    """The server itself is the router; the description comes when it already waits."""
    caplog.set_level(logging.INFO)
    endpoint = with_free_port("tcp/127.0.0.1:0")
    found = []

    def run():
        with open_server("topic:/robot_description", listen=endpoint, settings={"model_timeout": 60.0}, run=False) as s:
            found.append(s.endpoint)

    thread = threading.Thread(target=run)
    thread.start()
    # Retries until the server listens.
    config_connect = [endpoint]
    client = session(closing, "peer", ["tcp/127.0.0.1:0"], config_connect)
    latched(closing, client, ROS_KEY, String(data=PLAIN).to_cdr(), attachment())
    thread.join(90)
    assert found == [endpoint]
    lines = [record.message for record in caplog.records]
    assert any("the model comes from /robot_description" in line and endpoint in line for line in lines)
    assert any(
        "waiting for a message on /robot_description (Zenoh keys robot_description and 0/robot_description/" in line
        for line in lines
    )


@pytest.mark.parametrize("source", ["description.urdf", "description.xml"])
def test_a_second_server_simulates_what_the_first_one_publishes(tmp_path, source):
    (tmp_path / "description.urdf").write_text(PLAIN)
    (tmp_path / "description.xml").write_text(MJCF)
    plugins = {} if source.endswith("urdf") else {"robot_description": "robot_description"}
    with open_server(str(tmp_path / source), plugins=plugins) as first:
        options = {"namespace": "copy", "node_name": "second", "model_timeout": 60.0}
        with open_server("topic:/robot_description", connect=first.endpoint, settings=options, run=False) as second:
            names = [second.model.joint(i).name for i in range(second.model.njnt)]
            assert names == (["hinge"] if source.endswith("urdf") else ["j"])


def test_a_configuration_can_name_the_topic(closing, network):
    endpoint, client = network
    latched(closing, client, "lab/arm/description", String(data=PLAIN).to_cdr(), encoding=CDR)
    config = {
        "model": "topic:{ns}/arm/description",
        "namespace": "lab",
        "model_options": {"scene": "none"},
        "plugins": {"states": {"type": "joint_state_publisher"}},
        "zenoh": {"connect": [endpoint]},
    }
    with open_server(config, run=False) as server:
        assert server.model.ngeom == 1


def test_a_server_that_publishes_a_second_description_on_the_topic_says_so(closing, network, caplog):
    endpoint, client = network
    latched(closing, client, "robot_description", MJCF.encode())
    for topic, warned in (("/robot_description", True), ("/other", False)):
        caplog.clear()
        plugins = {"description": {"type": "robot_description", "topic": topic}}
        with served(endpoint, plugins=plugins, run=False):
            assert ("where its model comes from: late subscribers get two descriptions" in caplog.text) == warned


def test_mjcf_from_a_topic_can_be_put_into_a_scene(closing, network):
    endpoint, client = network
    latched(closing, client, "robot_description", MJCF.encode())
    with served(endpoint, settings={"model_options": {"scene": "tabletop"}}, run=False) as server:
        assert server.model.geom("scene_floor").name == "scene_floor"


def refusal(endpoint, **options):
    with pytest.raises(ModelError) as refused:
        served(endpoint, settings=QUICK, run=False, **options)
    return str(refused.value)


def test_without_a_message_the_wait_ends_with_the_keys_and_what_to_do(closing, network):
    endpoint, _ = network
    message = refusal(endpoint)
    assert message.startswith("no usable message on /robot_description within 1 s (Zenoh keys robot_description and 0/")
    assert "connected to 1 router" in message
    assert message.endswith("or check the name and the endpoints (model_timeout sets the time limit)")
    # Only the plain key without ROS 2.
    with pytest.raises(ModelError, match=r"Zenoh keys robot_description\)"):
        served(endpoint, settings=QUICK | {"ros2.enabled": False}, run=False)


def test_without_a_router_the_wait_ends_too():
    endpoint = with_free_port("tcp/127.0.0.1:0")
    with pytest.raises(WireError, match="waited 1 s for it"):
        served(endpoint, settings=QUICK, run=False)


@pytest.mark.parametrize(
    ("key", "payload", "reason"),
    [
        ("robot_description", String(data="").to_cdr(), "it is empty"),
        ("robot_description", String(data="robot.urdf").to_cdr(), "it is not valid XML"),
        ("robot_description", b"<html></html>", "its root element is <html>"),
        ("robot_description", b"<robot>\xff</robot>", "it is not UTF-8"),
        ("robot_description", b"\x00\x01\x00\x00\xff\xff\xff\xff", "string"),
        ("robot_description", b"<robot>" + b" " * (1 << 20), "at most 1048576 are accepted (zenoh.max_payload_bytes)"),
        ("robot_description", b"<a>" * 1000, "more than 200 elements deep"),
        ("robot_description", b'<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "document type declaration"),
        (OTHER_HASH, String(data=PLAIN).to_cdr(), "another definition of std_msgs/msg/String"),
    ],
)
def test_messages_that_are_no_model_are_reported_and_the_wait_goes_on(closing, network, caplog, key, payload, reason):
    endpoint, client = network
    latched(closing, client, key, payload)
    # Once the message is refused, a usable one comes on the other key.
    good = ROS_KEY if key == "robot_description" else "robot_description"
    log = Refusals(lambda: latched(closing, client, good, String(data=PLAIN).to_cdr(), attachment()))
    caplog.set_level(logging.INFO, "mjplug.server.topic_model")
    logger = logging.getLogger("mjplug.server.topic_model")
    logger.addHandler(log)
    closing.callback(logger.removeHandler, log)
    with served(endpoint, run=False) as server:
        assert server.model.njnt == 1
    assert f"a message on the key {key} is not used" in log.lines[0]
    assert reason in log.lines[0]


class Refusals(logging.Handler):
    """Keeps the lines about messages that are not used, and acts at the first one."""

    def __init__(self, act):
        super().__init__()
        self.lines, self._act = [], act

    def emit(self, record):
        if "is not used" in record.getMessage():
            self.lines.append(record.getMessage())
            if len(self.lines) == 1:
                self._act()


def test_a_name_that_is_no_topic_is_refused():
    with pytest.raises(ConfigError, match="model: "):
        open_server("topic:/robot description", run=False)
    with pytest.raises(ConfigError, match="model_timeout"):
        open_server("topic:/a", settings={"model_timeout": 0.0}, run=False)


def test_convert_writes_the_robot_on_a_topic_into_a_folder(closing, network, tmp_path):
    endpoint, client = network
    latched(closing, client, ROS_KEY, String(data=PLAIN).to_cdr(), attachment())
    command = [sys.executable, "-m", "mjplug", "convert", "topic:/robot_description"]
    command += ["-o", str(tmp_path / "out"), "--connect", endpoint]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("pendulum: 2 links, 1 moving joint, 1 position servo, fixed base")
    assert "waiting for a message on /robot_description" in done.stderr
    assert (tmp_path / "out" / "mjplug.yaml").is_file()


def test_convert_needs_the_full_name_of_a_topic_and_a_router():
    with pytest.raises(typer.BadParameter, match="a full name must start with '/'"):
        receive_description("topic:robot_description", None, 1.0)
    with pytest.raises(WireError):
        receive_description("topic:/robot_description", with_free_port("tcp/127.0.0.1:0"), 1.0)


def test_mjcf_needs_no_conversion(closing, network):
    endpoint, client = network
    latched(closing, client, ROS_KEY, String(data=MJCF).to_cdr(), attachment())
    with pytest.raises(ModelError, match="is MJCF, which needs no conversion; run it: mjplug serve topic:/robot_desc"):
        receive_description("topic:/robot_description", endpoint, 30.0)


def test_commands_that_do_not_wait_say_so():
    with pytest.raises(ModelError, match="only `mjplug serve`, `mjplug convert` and `open_server` wait for a model"):
        load_model("topic:/robot_description")
