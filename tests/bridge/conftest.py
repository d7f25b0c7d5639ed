"""A bridge, a server and a ROS node, each of which the others know by their messages only.

Where there is a real rclpy, it is used; otherwise the stand-in.
"""

import os
from pathlib import Path

import pytest
from bridge.graph import Graph
from bridge.installation import install
from bridge.process import REAL, SOURCE, STAND_IN, Bridge
from bridge.ros_side import RosSide
from cli.client import Client
from cli.process import Served

from mjplug.contracts.transport import ServiceName
from mjplug.wire.endpoints import with_free_port
from mjplug.wire.network import open_network
from mjplug.wire.session import SessionSettings
from mjplug_schemas.std_srvs import Trigger

WORLD = Path(__file__).parents[1] / "cli" / "world"
SERVER = ("scene.xml", "--plugin", "external_wrench", "--plugin", "heartbeat", "--plugin", "probe:Probe:probe")


@pytest.fixture(scope="session")
def installation(tmp_path_factory):
    """A folder with message packages, which the tests can import too."""
    prefix = tmp_path_factory.mktemp("ros") / "opt"
    install(prefix)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AMENT_PREFIX_PATH", str(prefix))
        from rclpy import _interfaces

        _interfaces.install()
        yield prefix


@pytest.fixture(scope="session")
def ros_environment(tmp_path_factory, request):
    """The environment of a shell in which ROS's setup file was sourced."""
    path = os.pathsep.join([str(SOURCE), *filter(None, [os.environ.get("PYTHONPATH")])])
    if REAL:
        yield {"PYTHONPATH": path}
        return
    graph = Graph(tmp_path_factory.mktemp("graph") / "socket")
    yield {
        "PYTHONPATH": os.pathsep.join([str(STAND_IN), path]),
        "RCLPY_STAND_IN": graph.address,
        "AMENT_PREFIX_PATH": str(request.getfixturevalue("installation")),
        "ROS_DISTRO": "jazzy",
    }
    graph.close()


@pytest.fixture(scope="session")
def ros_node(tmp_path_factory, ros_environment):
    side = RosSide(tmp_path_factory.mktemp("peer") / "socket", ros_environment)
    yield side
    side.close()


@pytest.fixture
def ros(ros_node):
    """The ROS node; what is made with it ends with the test."""
    yield ros_node
    ros_node.forget()


@pytest.fixture
def bridge(tmp_path, ros_environment):
    """Starts bridges with parameters, and sees to their end.

    Each has names of its own, as all are in one ROS graph: `/own` in front, `/clock` included.
    """
    bridges = []

    def bridge(*connect, env=(), **parameters):
        names = {"namespace": "/own", "remap": ["/clock:=/own/clock"]}
        environment = ros_environment | dict(env)
        bridges.append(Bridge(tmp_path, {"connect": list(connect)} | names | parameters, environment))
        return bridges[-1]

    yield bridge
    for each in bridges:
        each.finish()
    for each in bridges:
        assert "Traceback" not in each.log.text, each.log.text


@pytest.fixture
def serve():
    """Starts servers, and sees to their end."""
    servers = []

    def serve(*arguments, **options):
        servers.append(Served(*SERVER, *arguments, cwd=WORLD, **options))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


@pytest.fixture(scope="session")
def shared_server():
    server = Served(*SERVER, "--set", "plugins.heartbeat.update_rate=50.0", cwd=WORLD)
    yield server
    server.kill()


@pytest.fixture(scope="session")
def shared_bridge(shared_server, tmp_path_factory, ros_environment):
    """A bridge with its default names."""
    bridge = Bridge(tmp_path_factory.mktemp("bridge"), {"connect": [shared_server.endpoint]}, ros_environment)
    bridge.wait_for("are mapped")
    yield bridge
    assert bridge.stop() == 0, bridge.log.text
    assert "Traceback" not in bridge.log.text, bridge.log.text


@pytest.fixture
def zenoh_client(shared_server):
    """Sees what is on the other side of the bridge."""
    with Client(shared_server.endpoint) as client:
        yield client


@pytest.fixture
def free_endpoint():
    """Where nobody listens yet."""
    return with_free_port("tcp/127.0.0.1:0")


class Sim:
    """A server without a simulation, called /sim, to which a test adds what it wants.

    Attributes:
        responses: What its services answer, by their names; those that are not in it never do.
    """

    def __init__(self):
        self._network = open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/sim")
        self.endpoint = self._network.session.endpoint
        self.responses = {}
        self.close = self._network.close

    def open_service(self, name):
        def deliver(call):
            if name in self.responses:
                call.respond(self.responses[name])

        self._network.open_service(ServiceName(name, Trigger), deliver)

    def disappear(self):
        """Takes its token back, but stays."""
        self._network._claim.token.undeclare()

    @property
    def waiting(self):
        """How many calls wait for an answer."""
        return len(self._network.open_calls)

    def publish(self, topic):
        return self._network.open_publisher(topic)

    def subscribe(self, topic):
        self._network.open_subscription(topic, lambda message: None)


@pytest.fixture
def sim():
    sim = Sim()
    yield sim
    sim.close()
