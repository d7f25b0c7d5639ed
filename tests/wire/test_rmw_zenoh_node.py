"""The services that ROS 2 tools wait for at every node, called as a ROS 2 node would."""

import pytest
import zenoh
from waits import TIMEOUT

from mjplug.contracts.transport import DEFAULT, ServiceName, Topic
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug_schemas.definition import definition
from mjplug_schemas.rcl_interfaces import ListParameters
from mjplug_schemas.rihs01 import type_description, type_hash
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_srvs import Trigger
from mjplug_schemas.type_description_interfaces import GetTypeDescription


@pytest.fixture
def new_node(opened, client_of):
    """Opens a server; returns it, and a function that calls a service of its node."""

    def open_one(**settings):
        ros2 = RosSettings(**settings)
        network = opened(open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/robot1/mjplug", ros2=ros2))
        client = client_of(network.session.endpoint)

        def call(below, service, **request):
            replies = client.session.get(
                ros2.data_key(f"/robot1/mjplug/{below}", service),
                payload=service.Request(**request).to_cdr(),
                attachment=Attachment(1, 1, bytes(16)).to_bytes(),
                target=zenoh.QueryTarget.ALL_COMPLETE,
                timeout=TIMEOUT,
            )
            return [service.Response.from_cdr(bytes(reply.ok.payload)) for reply in replies]

        return network, call

    return open_one


@pytest.fixture
def call(new_node):
    """Calls a service of the node; the one response."""
    _, call = new_node()
    return lambda *below, **request: call(*below, **request)[0]


def test_types_in_use_are_described(new_node):
    network, call = new_node()
    network.open_publisher(Topic("/joint_states", JointState, DEFAULT))
    (response,) = call(
        "get_type_description", GetTypeDescription, type_name=JointState.TYPE, type_hash=type_hash(JointState)
    )
    assert response.successful
    told = response.type_description.model_dump()
    for individual in (told["type_description"], *told["referenced_type_descriptions"]):
        for field in individual["fields"]:
            assert field.pop("default_value") == ""
        individual["fields"] = list(individual["fields"])
    told["referenced_type_descriptions"] = list(told["referenced_type_descriptions"])
    assert told == type_description(JointState)
    assert [source.type_name for source in response.type_sources] == [
        "sensor_msgs/msg/JointState",
        "builtin_interfaces/msg/Time",
        "std_msgs/msg/Header",
    ]
    assert response.type_sources[0].raw_file_contents == definition(JointState)
    assert {source.encoding for source in response.type_sources} == {"msg"}
    (bare,) = call("get_type_description", GetTypeDescription, type_name=JointState.TYPE, include_type_sources=False)
    assert (bare.successful, bare.type_sources) == (True, ())


def test_services_are_described_too(new_node):
    network, call = new_node()
    network.open_service(ServiceName("/robot1/mjplug/list_parameters", ListParameters), lambda _: None)
    (response,) = call("get_type_description", GetTypeDescription, type_name=ListParameters.TYPE)
    assert response.successful
    encodings = {source.type_name.rpartition("/")[2]: source.encoding for source in response.type_sources}
    assert encodings["ListParameters"] == "srv"
    assert encodings["ListParameters_Request"] == encodings["ListParameters_Event"] == "implicit"
    assert encodings["ListParametersResult"] == "msg"


def test_other_types_and_other_hashes_are_refused(call):
    response = call("get_type_description", GetTypeDescription, type_name=Trigger.TYPE)
    assert (response.successful, response.failure_reason) == (
        False,
        "this node has no topic, service or action of type 'std_srvs/srv/Trigger'",
    )
    response = call("get_type_description", GetTypeDescription, type_name=GetTypeDescription.TYPE, type_hash="RIHS01_0")
    assert response.failure_reason == (
        f"the type hash of {GetTypeDescription.TYPE} is {type_hash(GetTypeDescription)} at this node, not RIHS01_0"
    )


def test_humble_asks_for_no_descriptions(new_node):
    _, call = new_node(distro="humble")
    assert call("get_type_description", GetTypeDescription, type_name=GetTypeDescription.TYPE) == []


def test_plain_clients_do_not_see_it(new_node, client_of):
    network, _ = new_node()
    client = client_of(network.session.endpoint)
    listing = client.call("robot1/mjplug/interfaces").json
    assert listing["services"] == []
    assert list(client.session.get("robot1/mjplug/get_type_description", timeout=TIMEOUT)) == []
