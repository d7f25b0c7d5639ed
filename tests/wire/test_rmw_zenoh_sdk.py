"""zenoh-ros2-sdk as a ROS 2 node: an independent implementation of rmw_zenoh's format."""

import json
import os
import queue
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import zenoh
from cli.process import Served
from waits import TIMEOUT
from wire.older_zenoh import python_with

from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED, LATEST, ServiceName, Topic
from mjplug.services.parameters import parameter_value
from mjplug.wire.endpoints import with_free_port
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug_schemas import registry
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.definition import definition
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench
from mjplug_schemas.rcl_interfaces import GetParameters
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String

PEER = Path(__file__).parent / "sdk_peer.py"
OLDER_PEER = Path(__file__).parent / "older_peer.py"

OLDER = [pytest.param(version, marks=[pytest.mark.slow, pytest.mark.timeout(240)]) for version in ("1.9.0", "1.5.0")]
"""Versions of Zenoh that peers may have; the server itself needs 1.6."""


@pytest.fixture(scope="module")
def definitions(tmp_path_factory):
    """A folder of all definitions, laid out like those of ROS."""
    folder = tmp_path_factory.mktemp("share")
    for name, interface in registry.all_types().items():
        file = folder / f"{name}.{name.split('/')[1]}"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(definition(interface))
    return folder


@pytest.fixture(scope="module")
def python_of(tmp_path_factory):
    """Returns the Python that has a version of Zenoh; None is the one of the server."""
    made = {None: sys.executable}

    def get(version):
        if version not in made:
            made[version] = python_with(version, tmp_path_factory.mktemp("zenoh") / version)
        return made[version]

    return get


@pytest.fixture
def start(tmp_path):
    """Starts a peer; returns its output as a queue of pairs."""
    started = []

    def start_one(*command, **environment):
        process = subprocess.Popen(
            command,
            env=os.environ | {"HOME": str(tmp_path), **environment},
            stdout=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        lines = queue.SimpleQueue()

        def read():
            for line in process.stdout:
                # The log of the library goes to the same place.
                if line.startswith("["):
                    lines.put(tuple(json.loads(line)))
            lines.put(("end", process.wait()))

        threading.Thread(target=read, daemon=True).start()
        return lines

    yield start_one
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def start_peer(start, python_of, definitions, tmp_path):
    """Starts zenoh-ros2-sdk on a version of Zenoh."""

    def start_one(endpoint, *arguments, version=None):
        environment = {
            "GIT_PYTHON_REFRESH": "quiet",
            "ROS_DOMAIN_ID": "0",
            "ZENOH_CONFIG_OVERRIDE": 'listen/endpoints=["tcp/127.0.0.1:0"]',
        }
        if version == "1.5.0":
            # The configuration that comes with it has settings of later versions.
            config = tmp_path / "zenoh.json5"
            config.write_text('{"mode": "peer", "scouting": {"multicast": {"enabled": false}}}')
            environment["ZENOH_SESSION_CONFIG_URI"] = str(config)
        port = endpoint.rpartition(":")[2]
        return start(python_of(version), PEER, port, definitions, *arguments, **environment)

    return start_one


@pytest.fixture
def router(opened):
    """The endpoint of what rmw_zenohd is: a bare Zenoh router."""
    endpoint = with_free_port("tcp/127.0.0.1:0")
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    opened(zenoh.open(config))
    return endpoint


@pytest.mark.parametrize("version", [None, *OLDER])
def test_a_foreign_node_subscribes_publishes_calls_and_lists(opened, start_peer, version):
    network = opened(open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/robot1/mjplug", ros2=RosSettings()))
    assert network.session.role == "router"
    meet(network, start_peer, version)


def test_a_foreign_node_does_so_where_a_router_was_first(opened, start_peer, router):
    network = opened(open_network(SessionSettings(listen=(router,)), "/robot1/mjplug", ros2=RosSettings()))
    assert (network.session.role, network.session.endpoint) == ("client", router)
    meet(network, start_peer)


def meet(network, start_peer, version=None):
    heard = {"heartbeat": threading.Event(), "clock": threading.Event()}
    twists, calls = queue.SimpleQueue(), queue.SimpleQueue()
    heartbeat = network.open_publisher(Topic("/mujoco_heartbeat", String, DEFAULT), heard["heartbeat"].set)
    clock = network.open_publisher(Topic("/clock", Clock, CLOCK), heard["clock"].set)
    network.open_subscription(Topic("/robot1/cmd_vel", Twist, LATEST), twists.put)
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), calls.put)
    peer = start_peer(network.session.endpoint, "pelvis", "/robot1/cmd_vel", version=version)
    assert all(event.wait(TIMEOUT) for event in heard.values())
    heartbeat.publish(String(data="alive"))
    assert peer.get(timeout=TIMEOUT) == ("/mujoco_heartbeat", "alive")
    clock.publish(Clock(clock=Time(sec=3, nanosec=20_000_000)))
    assert peer.get(timeout=TIMEOUT) == ("/clock", 20_000_000)
    assert twists.get(timeout=TIMEOUT) == Twist(linear=Vector3(x=0.5), angular=Vector3(z=-1.0))
    call = calls.get(timeout=TIMEOUT)
    (wrench,) = call.request.wrenches.external_wrenches
    assert (wrench.wrench.header.frame_id, wrench.wrench.wrench.force.x) == ("pelvis", 1.0)
    assert wrench.duration.nanosec == 300_000_000
    call.respond(ApplyExternalWrench.Response(success=True, message="the push is over"))
    told = dict(peer.get(timeout=TIMEOUT) for _ in range(5))
    assert told == {
        "response": [True, "the push is over"],
        "topics": {
            "/clock": ["rosgraph_msgs/msg/Clock"],
            "/mujoco_heartbeat": ["std_msgs/msg/String"],
            "/robot1/cmd_vel": ["geometry_msgs/msg/Twist"],
        },
        "services": {
            "/external_wrench/apply_wrench": ["mujoco_ros2_control_msgs/srv/ApplyExternalWrench"],
            "/robot1/mjplug/get_type_description": ["type_description_interfaces/srv/GetTypeDescription"],
        },
        "clock publisher": ["/robot1", "mjplug", "2::,1:,:,:,,"],
        "end": 0,
    }


@pytest.mark.parametrize("version", [None, *OLDER])
def test_nothing_is_lost_where_best_effort_and_reliable_topics_share_a_link(opened, start, python_of, version):
    network = opened(open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/mjplug", ros2=RosSettings()))
    topics = [Topic("/mujoco_heartbeat", String, DEFAULT), Topic("/clock", Clock, CLOCK)]
    matched = [threading.Event() for _ in topics]
    heartbeat, clock = (network.open_publisher(*each) for each in zip(topics, [m.set for m in matched], strict=True))
    name = Topic("/robot_name", String, LATCHED)
    network.open_publisher(name).publish(String(data="box"))
    keys = [RosSettings().data_key(topic.name, topic.type) for topic in (name, *topics)]
    peer = start(python_of(version), OLDER_PEER, network.session.endpoint, keys[0], "200", *keys[1:])
    assert all(event.wait(TIMEOUT) for event in matched)
    tick = threading.Event()
    for _ in range(200):
        # One right after the other, so that both leave in one batch.
        heartbeat.publish(String(data="alive"))
        clock.publish(Clock())
        tick.wait(0.001)
    numbers = list(range(1, 201))
    assert peer.get(timeout=TIMEOUT) == ("got", [["box"], numbers, numbers])


def test_a_foreign_node_meets_a_server_with_its_default_settings(start_peer, tmp_path):
    plugins = ("--plugin", "heartbeat", "--plugin", "external_wrench", "--speed", "2", "--quiet")
    served = Served("bundled:box", *plugins, cwd=tmp_path, env={"ROS_DOMAIN_ID": "0"})
    try:
        peer = start_peer(served.endpoint, "box")
        told = dict(peer.get(timeout=TIMEOUT) for _ in range(7))
        assert served.stop() == 0
    finally:
        served.kill()
    assert told["/mujoco_heartbeat"].startswith("MuJoCo ROS2 Control Heartbeat #")
    assert told["response"][0] is True
    assert told["topics"]["/mujoco_heartbeat"] == ["std_msgs/msg/String"]
    assert told["services"]["/mjplug/set_pause"] == ["mujoco_ros2_control_msgs/srv/SetPause"]
    assert told["clock publisher"] == ["/", "mjplug", "2::,1:,:,:,,"]
    assert told["end"] == 0
    # With the same definitions on both sides, nothing is logged.
    assert "type hash" not in served.err.text


def test_the_node_of_a_server_has_its_configuration_as_parameters(client_of, tmp_path):
    served = Served("bundled:box", "--set", "sim.seed=3", "--set", "ros2.domain_id=7", "--quiet", cwd=tmp_path)
    try:
        names = ("use_sim_time", "model", "sim.seed", "sim.speed")
        (reply,) = client_of(served.endpoint).session.get(
            RosSettings(7).data_key("/mjplug/get_parameters", GetParameters),
            payload=GetParameters.Request(names=names).to_cdr(),
            attachment=Attachment(1, 1, bytes(16)).to_bytes(),
            timeout=TIMEOUT,
        )
        values = GetParameters.Response.from_cdr(bytes(reply.ok.payload)).values
    finally:
        served.stop()
        served.kill()
    assert values == tuple(map(parameter_value, (True, "bundled:box", 3, 1.0)))


@pytest.mark.parametrize(
    ("options", "domains"),
    [(("--set", "ros2.enabled=false"), set()), ((), {"42"}), (("--set", "ros2.domain_id=7"), {"7"})],
)
def test_the_configuration_selects_who_sees_the_server(client_of, tmp_path, options, domains):
    served = Served("bundled:box", *options, cwd=tmp_path, env={"ROS_DOMAIN_ID": "42"})
    try:
        tokens = client_of(served.endpoint).session.liveliness().get("@ros2_lv/**", timeout=TIMEOUT)
        assert {str(reply.ok.key_expr).split("/")[1] for reply in tokens} == domains
    finally:
        served.stop()
        served.kill()
