"""The parameters of the bridge, and the errors for invalid values."""

import pytest
import yaml
from bridge.process import SOURCE
from waits import until

from mjplug.contracts.transport import DEFAULT, QoS, Topic
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String

ros_only = pytest.mark.ros


@pytest.fixture
def naming():
    from mjplug_bridge_ros2.naming import Naming

    return Naming


def test_the_parameter_file_has_every_parameter_with_its_default():
    from mjplug_bridge_ros2.settings import DEFAULTS

    told = yaml.safe_load((SOURCE / "config" / "bridge.yaml").read_text(encoding="utf-8"))
    assert told == {"/mjplug_bridge": {"ros__parameters": DEFAULTS}}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("/scan", "/robot1/scan"),
        ("/camera/image", "/robot1/camera/image"),
        ("/clock", "/clock"),
        ("/tf", "/sim/tf"),
        ("/camera/raw", None),
        ("/secret", None),
    ],
)
def test_names_are_chosen_then_renamed_then_put_into_the_namespace(naming, name, expected):
    import re

    rules = naming(
        allow=tuple(map(re.compile, ["/scan", "/camera/.*", "/clock", "/tf"])),
        deny=(re.compile(".*/raw"),),
        namespace="/robot1",
        remap={"/tf": "/sim/tf"},
    )
    assert rules.ros_name(name) == expected


@ros_only
def test_all_wrong_parameters_are_reported_at_once(bridge):
    own = bridge(
        zenoh_config="/no/such/file.json5",
        server="mjplug",
        namespace="/robot1/",
        allow=["/scan", "["],
        remap=["/scan=/robot1/scan"],
        service_timeout=0.0,
        deny="/scan",
    )
    assert own.end() == 2
    log = own.log.text
    assert "deny:" in log
    assert "zenoh_config: the file '/no/such/file.json5' does not exist" in log
    assert "server: 'mjplug' is not a full ROS name such as /robot1" in log
    assert "namespace: '/robot1/' is not a full ROS name" in log
    assert "allow: '[' is not a regular expression" in log
    assert "remap: '/scan=/robot1/scan' must be two full names separated by :=" in log
    assert "service_timeout: the value must be above 0 s, not 0.0" in log


@ros_only
def test_a_list_without_entries_is_a_list_without_entries(bridge, sim):
    # `-p deny:=[]` is a parameter without a value to ROS.
    sim.open_service("/go")
    own = bridge(sim.endpoint, deny=[], remap=[])
    own.wait_for("/sim: 0 topics and 1 services are mapped")
    assert own.stop() == 0


@ros_only
def test_without_an_endpoint_the_bridge_reports_it_together_with_the_other_mistakes(bridge):
    own = bridge(server="mjplug")
    assert own.end() == 2
    assert "connect: add an endpoint, such as tcp/127.0.0.1:7447" in own.log.text
    assert "server: 'mjplug' is not a full ROS name" in own.log.text


@ros_only
@pytest.mark.parametrize(("given", "code"), [(600, 0), (0, 2), (True, 2), ("600", 2)])
def test_a_time_may_be_an_integer_and_nothing_else_that_is_no_number(bridge, sim, given, code):
    own = bridge(sim.endpoint, service_timeout=given)
    if code == 0:
        own.wait_for("found /sim")
        assert own.stop() == 0
    else:
        assert own.end() == code
        assert "service_timeout: " in own.log.text


@ros_only
def test_an_endpoint_that_makes_no_sense_ends_the_bridge(bridge):
    own = bridge("nonsense")
    assert own.end() == 2
    assert "FATAL" in own.log.text
    assert "nonsense" in own.log.text


@ros_only
def test_only_what_is_allowed_is_mapped(ros, bridge, sim):
    for name in ("/go", "/stop"):
        sim.open_service(name)
    sim.publish(Topic("/a", String, DEFAULT))
    sim.publish(Topic("/b", String, DEFAULT))
    own = bridge(sim.endpoint, allow=["/go", "/a", "/b"], deny=["/b"])
    own.wait_for("/sim: 1 topics and 1 services are mapped")
    until(lambda: ros.types("/own/a") == ["std_msgs/msg/String"])
    assert ros.types("/own/b") == []
    assert not ros.is_ready("/own/stop", "std_srvs/srv/Trigger")()
    until(ros.is_ready("/own/go", "std_srvs/srv/Trigger"))


@ros_only
def test_the_clock_is_mapped_before_all_else_and_other_servers_are_left_alone(bridge, sim):
    sim.publish(Topic("/a", String, DEFAULT))
    sim.subscribe(Topic("/b", Twist, DEFAULT))
    sim.publish(Topic("/clock", Clock, QoS(1, "best_effort")))
    other = bridge(sim.endpoint, server="/other")
    own = bridge(sim.endpoint, server="/sim", qos_overrides=_reliability("/own/clock", "/own/a", "/own/b"))
    own.wait_for("/sim: 0 topics and 0 services are mapped")
    refused = [line for line in own.log.text.splitlines() if "is not mapped" in line]
    assert [line.split(": ")[1].split()[0] for line in refused] == ["/own/clock", "/own/a", "/own/b"]
    assert "Unexpected QoS override for policy `reliability`: `often`" in own.log.text
    other.wait_for("waiting for a server")
    assert other.stop() == 0, other.log.text
    assert "found /" not in other.log.text


@ros_only
def test_the_quality_of_service_is_the_servers_unless_a_parameter_says_otherwise(ros, bridge, sim):
    best_effort = QoS(depth=5, reliability="best_effort")
    publishers = {name: sim.publish(Topic(name, String, best_effort)) for name in ("/a", "/b")}
    own = bridge(sim.endpoint, qos_overrides={"/own/b": {"publisher": {"reliability": "reliable"}}})
    own.wait_for("/sim: 2 topics and 0 services are mapped")
    # A best-effort publisher does not match a reliable subscription.
    demanding = {name: ros.subscribe(f"/own{name}", "std_msgs/msg/String") for name in publishers}
    modest = {name: ros.subscribe(f"/own{name}", "std_msgs/msg/String", reliable=False) for name in publishers}
    for name, publisher in publishers.items():
        until(lambda publisher=publisher: publisher.matched)
        publisher.publish(String(data=name))
        assert String.from_cdr(modest[name].next()).data == name
    assert String.from_cdr(demanding["/b"].next()).data == "/b"
    assert demanding["/a"].drain() == []


@ros_only
def test_a_topic_that_the_server_both_writes_and_reads_does_not_go_in_circles(ros, bridge, sim):
    publisher = sim.publish(Topic("/both", String, DEFAULT))
    sim.subscribe(Topic("/both", String, DEFAULT))
    own = bridge(sim.endpoint)
    own.wait_for(r"WARN.*/own/both \(std_msgs/msg/String\) is not mapped: .*would return to their sender")
    inbox = ros.subscribe("/own/both", "std_msgs/msg/String")
    sent = []

    def arrives():
        sent.append(f"message {len(sent)}")
        publisher.publish(String(data=sent[-1]))
        return len(arrived := inbox.drain()) > 0 and received.extend(arrived) is None

    received = []
    until(arrives)
    while String.from_cdr(received[-1]).data != sent[-1]:
        received.append(inbox.next())
    assert [String.from_cdr(payload).data for payload in received] == sent[-len(received) :]


def _reliability(*names):
    return {name: {kind: {"reliability": "often"} for kind in ("publisher", "subscription")} for name in names}
