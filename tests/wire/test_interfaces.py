import json

import pytest
from waits import TIMEOUT

from mjplug.contracts.transport import CLOCK, DEFAULT, ServiceName, Topic
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_srvs import Trigger


@pytest.fixture
def busy_network(network):
    network.open_publisher(Topic("/clock", Clock, CLOCK))
    network.open_subscription(Topic("/base/cmd_vel", Twist, DEFAULT), print)
    network.open_service(ServiceName("/mjplug/go", Trigger), print)
    return network


def test_the_listing_names_everything_that_is_declared(busy_network, client):
    answer = client.call("mjplug/interfaces")
    assert (answer.key, answer.encoding) == ("mjplug/interfaces", "application/json")
    listing = answer.json
    assert listing.pop("version")
    assert listing == {
        "name": "/mjplug",
        "endpoint": busy_network.session.endpoint,
        "topics": [
            {
                "name": "/clock",
                "direction": "published",
                "key": "clock",
                "json_key": "clock/@json",
                "type": "rosgraph_msgs/msg/Clock",
                "hash": "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
                "qos": {"depth": 1, "reliability": "best_effort", "durability": "volatile"},
            },
            {
                "name": "/base/cmd_vel",
                "direction": "subscribed",
                "key": "base/cmd_vel",
                "json_key": "base/cmd_vel/@json",
                "type": "geometry_msgs/msg/Twist",
                "hash": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
                "qos": {"depth": 10, "reliability": "reliable", "durability": "volatile"},
            },
        ],
        "services": [
            {
                "name": "/mjplug/go",
                "key": "mjplug/go",
                "type": "std_srvs/srv/Trigger",
                "hash": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
            }
        ],
        "actions": [],
    }


def test_what_is_declared_later_is_listed_too(busy_network, client):
    before = client.call("mjplug/interfaces").json
    busy_network.open_service(ServiceName("/later", Trigger), print)
    after = client.call("mjplug/interfaces").json
    assert [service["name"] for service in before["services"]] == ["/mjplug/go"]
    assert [service["name"] for service in after["services"]] == ["/mjplug/go", "/later"]


def test_a_subscriber_is_notified_of_each_change_and_can_query_it(busy_network, client):
    changes = client.listen("mjplug/interfaces")
    client.settle()
    for number in (1, 2):
        busy_network.open_service(ServiceName(f"/later{number}", Trigger), print)
        assert changes.get(timeout=TIMEOUT).payload.to_bytes() == b""
        assert client.call("mjplug/interfaces").json["services"][-1]["name"] == f"/later{number}"
    assert changes.empty()


def test_schemas_are_returned_on_request(busy_network, client):
    types = client.call("mjplug/interfaces?schema=true").json["types"]
    # With the types of their fields.
    assert types.keys() == {
        "rosgraph_msgs/msg/Clock", "builtin_interfaces/msg/Time",
        "geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3",
        "std_srvs/srv/Trigger",
    }  # fmt: skip
    assert "builtin_interfaces/Time clock" in types["rosgraph_msgs/msg/Clock"]["definition"]
    assert types["geometry_msgs/msg/Twist"]["schema"]["properties"].keys() == {"linear", "angular"}
    assert types["std_srvs/srv/Trigger"]["response"]["properties"].keys() == {"success", "message"}
    assert "---" in types["std_srvs/srv/Trigger"]["definition"]


def test_the_listing_of_a_server_in_a_namespace_is_under_its_name(new_network, client_of):
    network = new_network("/robot1/sim")
    answer = client_of(network.session.endpoint).call("robot1/sim/interfaces")
    assert json.loads(answer.payload)["name"] == "/robot1/sim"
