"""A namespace moves every topic, service and frame of an instance that the user has not given as absolute."""

import mujoco
import pytest

from mjplug.config.settings import Settings
from mjplug.physics.simulation import Simulation
from mjplug.plugin.registry import find
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.testing import FakeTransport, InlineWorkerPool
from mjplug_schemas.message import Message

ROBOT = """
<mujoco>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="base_link" pos="0 0 .5"><freejoint/><geom size=".1" mass="1"/>
      <site name="laser"/><camera name="eye" resolution="8 6"/>
      <replicate count="3" sep="-" euler="0 0 10"><site name="ray" zaxis="1 0 0"/></replicate>
      <body name="arm"><joint name="shoulder"/><geom size=".05" mass=".1"/></body>
      <body name="left" pos="0 .2 0"><joint name="left" axis="0 1 0"/><geom size=".05" mass=".1"/></body>
      <body name="right" pos="0 -.2 0"><joint name="right" axis="0 1 0"/><geom size=".05" mass=".1"/></body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder"/>
    <velocity name="left" joint="left" kv=".01"/>
    <velocity name="right" joint="right" kv=".01"/>
  </actuator>
  <sensor><gyro name="imu" site="laser"/><rangefinder name="rays" site="ray-0"/>
    <rangefinder name="rays-0" site="ray-0"/><rangefinder name="rays-1" site="ray-1"/>
    <rangefinder name="rays-2" site="ray-2"/></sensor>
</mujoco>
"""

LASER = {"site": "laser", "resolution": [8, 1], "azimuth_range": [-1, 1], "elevation_range": 0, "max_range": 5}
RAYS = {"frame_name": "rays_frame", "min_angle": 0.0, "max_angle": 0.2, "angle_increment": 0.1}

PLUGINS = {
    "beat": {"type": "heartbeat"},
    "push": {"type": "external_wrench"},
    "drive": {"type": "base_velocity", "body": "base_link"},
    "wheels": {"type": "diff_drive", "wheel_radius": 0.05, "cmd_vel_topic": "{ns}/wheels/cmd_vel"},
    "free": {"type": "free_joint_state_publisher"},
    "rangefinders": {"type": "rangefinder_lidar", "rays": RAYS},
    "lidar": {"type": "lidar", "laser": LASER},
    "camera": {"type": "camera"},
    "states": {"type": "joint_state_publisher"},
    "commands": {"type": "joint_commands"},
    "sensors": {"type": "sensors"},
    "frames": {"type": "transforms"},
    "odometry": {"type": "odometry", "publish_tf": True},
    "description": {"type": "robot_description", "file": "package://mujoco/x"},
}

ABSOLUTE = {"/clock", "/diagnostics", "/rosout"}
"""What stays where it is whatever the namespace; see concepts.md."""


def own_action(namespace):
    """The topics of the server's own action."""
    return {f"{namespace}/simulate_steps/_action/{part}" for part in ("feedback", "status")}


@pytest.fixture
def start(request):
    """Starts plugins in a server without threads, and returns its transport."""

    def start(plugins, workers=OfflineWorkerPool, **settings):
        settings = Settings.model_validate({"model": "?", "plugins": plugins, **settings})
        selected = [
            Selected(name, cls := find(entry.type), cls.parameters_type.model_validate(entry.parameters))
            for name, entry in settings.plugins.items()
        ]
        transport = FakeTransport()
        simulation = Simulation(mujoco.MjModel.from_xml_string(ROBOT))
        server = Server(settings, simulation, transport, selected, workers())
        request.addfinalizer(server.cleanup)
        transport.server = server
        return transport

    return start


@pytest.fixture
def every_plugin(tmp_path):
    (tmp_path / "robot.urdf").write_text("<robot name='r'><link name='base'/></robot>")
    return {**PLUGINS, "description": {"type": "robot_description", "file": str(tmp_path / "robot.urdf")}}


def test_every_name_of_every_plugin_moves_below_the_namespace(start, every_plugin):
    plain, moved = start(every_plugin), start(every_plugin, namespace="robot1")
    assert set(moved.types) == {name if name in ABSOLUTE else f"/robot1{name}" for name in plain.types}
    assert {"/robot1/scan", "/robot1/odom", "/robot1/tf", "/robot1/tf_static", "/robot1/joint_states"} <= set(
        moved.types
    )


def test_the_plugins_of_this_test_are_all_there_are(every_plugin):
    from mjplug.plugin.registry import registered

    classes = {point.value for point in registered().values()}
    assert {registered()[entry["type"]].value for entry in every_plugin.values()} == classes


def test_an_absolute_name_of_the_user_stays(start):
    moved = start({"o": {"type": "odometry", "topic": "/odom"}, "p": {"type": "odometry"}}, namespace="robot1")
    assert {"/odom", "/robot1/odom"} <= set(moved.publishers)


def test_the_namespace_of_an_instance_is_below_that_of_the_server_unless_it_is_absolute(start):
    plugins = {
        "a": {"type": "heartbeat", "namespace": "red", "topic": "beat"},
        "b": {"type": "heartbeat", "namespace": "/blue"},
        "c": {"type": "heartbeat"},
        "d": {"type": "heartbeat", "namespace": "/"},
    }
    published = set(start(plugins, namespace="fleet").publishers) - ABSOLUTE
    assert published == {
        "/fleet/red/a/beat", "/blue/mujoco_heartbeat", "/fleet/mujoco_heartbeat", "/mujoco_heartbeat",
        "/fleet/mjplug/epoch", *own_action("/fleet"),
    }  # fmt: skip


def test_an_instance_with_the_name_of_the_server_does_not_move_the_server(start):
    transport = start({"mjplug": {"type": "heartbeat", "namespace": "red", "topic": "beat"}})
    assert {"/red/mjplug/beat", "/mjplug/epoch"} <= set(transport.publishers)


@pytest.mark.parametrize(
    ("entry", "topic"),
    [
        ({}, "/mujoco_heartbeat"),
        ({"topic": "beat"}, "/robot1/x/beat"),
        ({"topic": "{ns}/beat"}, "/robot1/beat"),
        ({"namespace": "arm"}, "/robot1/arm/mujoco_heartbeat"),
    ],
)
def test_the_names_of_mujoco_ros2_control_keep_the_absolute_defaults_documented_there(start, entry, topic):
    plugin = {"type": "mujoco_ros2_control_plugins/HeartbeatPublisherPlugin", **entry}
    published = set(start({"x": plugin}, namespace="robot1").publishers)
    assert published == {topic, "/robot1/mjplug/epoch"} | own_action("/robot1") | ABSOLUTE


def frames(value):
    """Yields every frame in a message."""
    for name, part in value:
        if name in ("frame_id", "child_frame_id"):
            yield part
        for item in part if isinstance(part, tuple | list) else (part,):
            if isinstance(item, Message):
                yield from frames(item)


def messages_of(transport):
    """Steps the server for 0.3 s, and returns the messages of each topic."""
    for _ in range(150):
        transport.server.loop.step(1)
    return {name: publisher.messages for name, publisher in transport.publishers.items() if publisher.messages}


def test_every_frame_gets_the_prefix(start, every_plugin):
    plugins = {name: entry for name, entry in every_plugin.items() if name not in ("camera", "free")}
    plugins["frames"] = {"type": "transforms", "world_frame": "/map", "frames": {"tool": {"body": "arm"}}}
    plugins["states"] = {"type": "joint_state_publisher", "frame_id": "base"}
    plugins["rangefinders"] = {"type": "rangefinder_lidar", "rays": {**RAYS, "laserscan_topic": "{ns}/rays"}}
    plugins["odometry"] = {"type": "odometry"}
    transport = start(plugins, InlineWorkerPool, namespace="robot1", frame_prefix="{ns}/")
    seen = {
        name: {frame for message in messages for frame in frames(message)}
        for name, messages in messages_of(transport).items()
    }
    assert seen["/robot1/scan"] == {"robot1/laser"}
    assert seen["/robot1/rays"] == {"robot1/rays_frame"}
    assert seen["/robot1/odom"] == {"robot1/odom", "robot1/base_link"}
    assert seen["/robot1/joint_states"] == {"robot1/base"}
    assert {"map", "robot1/base_link", "robot1/arm"} <= seen["/robot1/tf"]
    assert "robot1/tool" in seen["/robot1/tf_static"]
    for name, found in seen.items():
        assert all(frame.startswith("robot1/") or frame in ("map", "") for frame in found), name


@pytest.mark.parametrize(
    ("settings", "entry", "frame"),
    [
        ({}, {}, "odom"),
        ({"frame_prefix": "r_"}, {}, "r_odom"),
        ({"frame_prefix": "r_"}, {"frame_prefix": ""}, "odom"),
        ({"frame_prefix": "r_"}, {"frame_prefix": "s/"}, "s/odom"),
        ({"frame_prefix": "{ns}/"}, {}, "odom"),
        ({"frame_prefix": "{ns}/", "namespace": "a/b"}, {}, "a/b/odom"),
        ({"frame_prefix": "{ns}/", "namespace": "a"}, {"namespace": "b"}, "a/b/odom"),
        ({"frame_prefix": "x_{ns}_", "namespace": "a"}, {"frame_id": "/odom"}, "odom"),
    ],
)
def test_the_prefix_of_an_instance_replaces_that_of_the_server(start, settings, entry, frame):
    transport = start({"o": {"type": "odometry", "topic": "/odom", **entry}}, **settings)
    (message, *_) = messages_of(transport)["/odom"]
    assert message.header.frame_id == frame


class KeptOrders(OfflineWorkerPool):
    """Keeps what plugins hand to worker processes."""

    def __init__(self, orders):
        self.orders = orders

    def start(self, order, simulation, inbox):
        self.orders.append(order)
        return super().start(order, simulation, inbox)


def test_the_frames_of_cameras_get_the_prefix(start):
    orders = []
    start({"camera": {"type": "camera"}}, lambda: KeptOrders(orders), frame_prefix="red/")
    (order,) = orders
    assert [view.frame for view in order.work._views] == ["red/eye_frame"]


@pytest.mark.parametrize("prefix", ["/a", "a b", "{node}/", "a{", "a\n"])
def test_a_bad_prefix_is_refused(prefix):
    with pytest.raises(ValueError, match="a frame prefix must not contain spaces"):
        Settings(model="?", frame_prefix=prefix)


def test_the_arrows_of_a_wrench_are_in_the_prefixed_frame_of_the_body(start):
    from mjplug_schemas.builtin_interfaces import Duration
    from mjplug_schemas.geometry_msgs import Vector3, Wrench, WrenchStamped
    from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrench, ExternalWrenchArray
    from mjplug_schemas.std_msgs import Header

    transport = start({"push": {"type": "external_wrench"}}, frame_prefix="red/")
    wrench = WrenchStamped(header=Header(frame_id="arm"), wrench=Wrench(force=Vector3(x=1.0)))
    request = ExternalWrenchArray(external_wrenches=[ExternalWrench(wrench=wrench, duration=Duration.from_ns(10**8))])
    call = transport.call("/push/apply_wrench", ApplyExternalWrench.Request(wrenches=request))
    shown = messages_of(transport)["/push/wrench_markers"]
    assert call.response.success
    assert {marker.header.frame_id for message in shown for marker in message.markers} == {"red/arm"}
    # Both the arrows and their deletion.
    assert {marker.action for message in shown for marker in message.markers} == {0, 2}
