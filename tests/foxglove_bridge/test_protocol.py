"""`mjplug foxglove` as a client of its WebSocket protocol sees it."""

import itertools
import json
import re
import signal
import struct
import subprocess
import time

import pytest
from cli.process import COMMAND, STARTING, Lines, Served, environment, run
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import connect

from mjplug.client import connect as connect_to_server
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import String

TIMEOUT = 60.0
MESSAGE, TIME, RESPONSE = 1, 2, 3
REQUEST, CLIENT_MESSAGE = 2, 1


class Viewer:
    """Speaks the protocol as Foxglove does."""

    def __init__(self, address):
        self.socket = connect(address, subprotocols=["foxglove.sdk.v1"], legacy=True, max_size=None)
        self.channels, self.services, self.others = {}, {}, []
        self.binary, self.wanted = [], []

    def send(self, **fields):
        self.socket.send(json.dumps(fields))

    def until(self, condition):
        """Receives until a condition is true."""
        until = time.monotonic() + TIMEOUT
        while not condition():
            received = self.socket.recv(timeout=max(0.1, until - time.monotonic()))
            if isinstance(received, bytes):
                self.binary.append(received)
                continue
            content = json.loads(received)
            if content["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in content["channels"]}
            elif content["op"] == "advertiseServices":
                self.services |= {service["name"]: service for service in content["services"]}
            else:
                self.others.append(content)
                if "unknown channel" in content.get("message", ""):
                    # The SDK announces a channel a moment before it accepts subscriptions to it.
                    self.send(op="subscribe", subscriptions=self.wanted)

    def messages(self, id):
        """Times and payloads of the messages of a subscription."""
        found = [message for message in self.binary if message[0] == MESSAGE]
        return [(struct.unpack_from("<Q", m, 5)[0], m[13:]) for m in found if struct.unpack_from("<I", m, 1)[0] == id]

    def subscribe(self, id, topic):
        self.until(lambda: topic in self.channels)
        self.wanted = [{"id": id, "channelId": self.channels[topic]["id"]}]
        self.send(op="subscribe", subscriptions=self.wanted)

    def call(self, service, payload):
        encoding = b"cdr"
        self.until(lambda: service in self.services)
        head = struct.pack("<BIII", REQUEST, self.services[service]["id"], 7, len(encoding))
        before = len(self.others)
        self.socket.send(head + encoding + payload)
        self.until(
            lambda: (
                any(m[0] == RESPONSE for m in self.binary)
                or any(other["op"] == "serviceCallFailure" for other in self.others[before:])
            )
        )
        failures = [other for other in self.others[before:] if other["op"] == "serviceCallFailure"]
        if failures:
            return failures[0]
        (response,) = (m for m in self.binary if m[0] == RESPONSE)
        self.binary.remove(response)
        _, call, length = struct.unpack_from("<III", response, 1)
        assert call == 7
        return response[13 + length :]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    served = Served(
        "bundled:mobile_base", "--plugin", "joint_state_publisher", "--plugin", "robot_description",
        "--plugin", "base_velocity", "--set", "plugins.base_velocity.body=base_link",
        cwd=tmp_path_factory.mktemp("server"),
    )  # fmt: skip
    yield served
    assert served.stop() == 0


class Bridge:
    def __init__(self, server, folder, *words):
        self.process = subprocess.Popen(
            [*COMMAND, "foxglove", "--port", "0", *words], cwd=folder,
            env=environment({"MJPLUG_CONNECT": server.endpoint}),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)
        self.address = self.out.wait_for(r"ready · (ws://127\.0\.0\.1:\d+)", STARTING)[1]

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(TIMEOUT) == 0
        assert "Traceback" not in self.err.wait_for_end()


@pytest.fixture(scope="module")
def bridge(server, tmp_path_factory):
    running = Bridge(server, tmp_path_factory.mktemp("bridge"))
    yield running
    running.stop()


@pytest.fixture
def viewer(bridge):
    viewer = Viewer(bridge.address)
    yield viewer
    viewer.socket.close()


def test_a_viewer_gets_channels_with_types_that_others_can_decode_and_messages_at_their_simulated_time(viewer):
    viewer.subscribe(1, "/joint_states")
    viewer.until(lambda: len(viewer.messages(1)) >= 5 and any(m[0] == TIME for m in viewer.binary))
    channel = viewer.channels["/joint_states"]
    assert (channel["encoding"], channel["schemaName"], channel["schemaEncoding"]) == (
        "cdr", "sensor_msgs/msg/JointState", "ros2msg",
    )  # fmt: skip
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    for log_time, payload in viewer.messages(1):
        theirs = store.deserialize_cdr(payload, channel["schemaName"])
        ours = JointState.from_cdr(payload)
        assert (tuple(theirs.name), tuple(theirs.position)) == (ours.name, ours.position)
        assert ours.name
        assert log_time == ours.header.stamp.sec * 10**9 + ours.header.stamp.nanosec
    # Only what is subscribed to is sent.
    assert {struct.unpack_from("<I", m, 1)[0] for m in viewer.binary if m[0] == MESSAGE} == {1}
    viewer.send(op="unsubscribe", subscriptionIds=[1])


def test_each_viewer_gets_the_last_message_of_a_latched_topic(bridge):
    for _ in range(2):
        viewer = Viewer(bridge.address)
        viewer.subscribe(5, "/robot_description")
        viewer.until(lambda viewer=viewer: viewer.messages(5))
        assert String.from_cdr(viewer.messages(5)[0][1]).data.count("<") > 5
        other = Viewer(bridge.address)
        other.subscribe(6, "/robot_description")
        other.until(lambda other=other: other.messages(6))
        for one in (viewer, other):
            one.socket.close()


def test_services_are_called_and_refusals_are_shown(viewer, server):
    for paused, message in ((True, "the simulation is now paused"), (False, "the simulation is now running")):
        request = SetPause.Request(paused=paused).to_cdr()
        response = SetPause.Response.from_cdr(viewer.call("/mjplug/set_pause", request))
        assert response == SetPause.Response(success=True, message=message)
    failure = viewer.call("/mjplug/set_pause", b"\0\1\0\0")
    assert "SetPause_Request" in failure["message"]
    service = viewer.services["/mjplug/set_pause"]
    assert service["type"] == "mujoco_ros2_control_msgs/SetPause"
    assert "bool paused" in service["request"]["schema"]


def test_a_viewer_publishes_commands(viewer, server):
    twist = Twist(linear=Vector3(x=0.25))
    with connect_to_server(server.endpoint) as client:
        commands = client.subscribe("/base_velocity/cmd_vel", Twist)
        viewer.until(lambda: "/base_velocity/cmd_vel" in viewer.channels)
        channel = {
            "id": 3,
            "topic": "/base_velocity/cmd_vel",
            "encoding": "cdr",
            "schemaName": "geometry_msgs/msg/Twist",
        }
        viewer.send(op="advertise", channels=[channel])
        viewer.socket.send(struct.pack("<BI", CLIENT_MESSAGE, 3) + twist.to_cdr())
        assert commands.next(TIMEOUT) == twist
        viewer.send(op="unadvertise", channelIds=[3])


def test_parameters_are_read_and_set(viewer):
    ids = itertools.count()

    def answer(**fields):
        until = time.monotonic() + TIMEOUT
        while time.monotonic() < until:
            id = str(next(ids))
            viewer.send(id=id, **fields)
            viewer.until(lambda id=id: any(other.get("id") == id for other in viewer.others))
            (found,) = (other for other in viewer.others if other.get("id") == id)
            # A server on a busy machine may not answer in time; then there is a status message, and no parameter.
            if found["parameters"]:
                return {parameter["name"]: parameter["value"] for parameter in found["parameters"]}
        raise AssertionError(viewer.others)

    values = answer(op="getParameters", parameterNames=[])
    assert values["/mjplug.sim.speed"] in (1, "1.0", 1.0)
    speed = {"name": "/mjplug.sim.speed", "value": 2.0, "type": "float64"}
    assert answer(op="setParameters", parameters=[speed])["/mjplug.sim.speed"] == 2.0
    wrong = {"name": "/mjplug.sim.speed", "value": -3.0, "type": "float64"}
    assert answer(op="setParameters", parameters=[wrong])["/mjplug.sim.speed"] == 2.0
    viewer.until(lambda: any("-3.0" in other.get("message", "") for other in viewer.others))
    assert answer(op="setParameters", parameters=[speed | {"value": 1.0}])["/mjplug.sim.speed"] == 1.0


@pytest.fixture
def read_only(server, tmp_path):
    bridge = Bridge(server, tmp_path, "--read-only")
    yield bridge
    if bridge.process.poll() is None:
        bridge.process.kill()
        bridge.process.wait()


def test_a_read_only_server_offers_neither_services_nor_parameters(server, read_only, tmp_path):
    bridge = read_only
    viewer = Viewer(bridge.address)
    viewer.subscribe(1, "/joint_states")
    viewer.until(lambda: viewer.messages(1))
    (info,) = (other for other in viewer.others if other["op"] == "serverInfo")
    assert info["capabilities"] == ["time"]
    assert viewer.services == {}
    viewer.socket.close()
    port = re.search(r"\d+$", bridge.address)[0]
    taken = run("foxglove", "--port", port, cwd=tmp_path, env={"MJPLUG_CONNECT": server.endpoint})
    assert taken.returncode == 1
    assert re.match(
        rf"error: cannot listen on 127\.0\.0\.1:{port}: .*; choose another port with --port\n", taken.stderr
    )
    bridge.stop()
