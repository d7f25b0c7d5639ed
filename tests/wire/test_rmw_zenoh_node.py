"""The services that ROS 2 tools wait for at every node, called as a ROS 2 node would."""

import pytest
import zenoh

from mjplug.transport import DEFAULT, Topic
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.parameters import ParameterServices
from mjplug.wire.session import SessionSettings
from mjplug_schemas.definition import definition
from mjplug_schemas.rcl_interfaces import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    Parameter,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
    SetParameters,
    SetParametersAtomically,
)
from mjplug_schemas.rihs01 import type_description, type_hash
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_srvs import Trigger
from mjplug_schemas.type_description_interfaces import GetTypeDescription

PATIENCE = 5.0
PARAMETERS = {"use_sim_time": True, "sim.seed": 7, "sim.speed": 0.5, "model": "bundled:box", "sim.viewer.on": False}
YES = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
NO = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=False)


@pytest.fixture
def new_node(opened, client_of):
    """Opens a server; returns it, and a function that calls a service of its node."""

    def open_one(**settings):
        ros2 = RosSettings(parameters=PARAMETERS, **settings)
        network = opened(open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/robot1/mjplug", ros2=ros2))
        client = client_of(network.session.endpoint)

        def call(below, service, **request):
            replies = client.session.get(
                ros2.data_key(f"/robot1/mjplug/{below}", service),
                payload=service.Request(**request).to_cdr(),
                attachment=Attachment(1, 1, bytes(16)).to_bytes(),
                target=zenoh.QueryTarget.ALL_COMPLETE,
                timeout=PATIENCE,
            )
            return [service.Response.from_cdr(bytes(reply.ok.payload)) for reply in replies]

        return network, call

    return open_one


@pytest.fixture
def call(new_node):
    """Calls a service of the node; the one response."""
    _, call = new_node()
    return lambda *below, **request: call(*below, **request)[0]


def test_parameters_are_listed_typed_and_read(call):
    names = call("list_parameters", ListParameters).result
    assert names.names == ("model", "sim.seed", "sim.speed", "sim.viewer.on", "use_sim_time")
    assert names.prefixes == ("sim", "sim.viewer")
    asked = ("use_sim_time", "sim.seed", "sim.speed", "model", "no_such")
    assert call("get_parameters", GetParameters, names=asked).values == (
        YES,
        ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=7),
        ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.5),
        ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="bundled:box"),
        ParameterValue(),
    )
    assert call("get_parameter_types", GetParameterTypes, names=asked).types == bytes([1, 2, 3, 4, 0])
    assert call("describe_parameters", DescribeParameters, names=("use_sim_time", "no_such")).descriptors == (
        ParameterDescriptor(name="use_sim_time", type=1, read_only=True),
        ParameterDescriptor(name="no_such"),
    )


@pytest.mark.parametrize(
    ("prefixes", "depth", "names"),
    [
        ((), 1, ("model", "use_sim_time")),
        ((), 2, ("model", "sim.seed", "sim.speed", "use_sim_time")),
        (("sim",), 0, ("sim.seed", "sim.speed", "sim.viewer.on")),
        (("sim",), 1, ("sim.seed", "sim.speed")),
        (("sim.viewer", "model"), 1, ("model", "sim.viewer.on")),
        (("si",), 0, ()),
    ],
)
def test_parameters_are_listed_by_group_and_depth(prefixes, depth, names):
    _, list_parameters = ParameterServices(PARAMETERS).handlers["list_parameters"]
    assert list_parameters(ListParameters.Request(prefixes=prefixes, depth=depth)).result.names == names


def test_parameters_are_read_only_but_may_be_set_to_what_they_are(call):
    same = Parameter(name="use_sim_time", value=YES)
    other = Parameter(name="use_sim_time", value=NO)
    unknown = Parameter(name="speed", value=NO)
    results = call("set_parameters", SetParameters, parameters=(same, other, unknown)).results
    assert [result.successful for result in results] == [True, False, False]
    assert results[1].reason == "parameter 'use_sim_time' is read-only; it comes from the configuration of the server"
    assert results[2].reason.startswith("there is no parameter 'speed'; there are model, sim.seed")
    atomically = "set_parameters_atomically"
    assert call(atomically, SetParametersAtomically, parameters=(same,)).result.successful
    assert call(atomically, SetParametersAtomically, parameters=(same, unknown)).result == results[2]


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


def test_services_are_described_too(call):
    response = call("get_type_description", GetTypeDescription, type_name=ListParameters.TYPE)
    assert response.successful
    encodings = {source.type_name.rpartition("/")[2]: source.encoding for source in response.type_sources}
    assert encodings["ListParameters"] == "srv"
    assert encodings["ListParameters_Request"] == encodings["ListParameters_Event"] == "implicit"
    assert encodings["ListParametersResult"] == "msg"


def test_other_types_and_other_hashes_are_refused(call):
    response = call("get_type_description", GetTypeDescription, type_name=Trigger.TYPE)
    assert (response.successful, response.failure_reason) == (
        False,
        "this node has no topic or service of type 'std_srvs/srv/Trigger'",
    )
    response = call("get_type_description", GetTypeDescription, type_name=GetParameters.TYPE, type_hash="RIHS01_0")
    assert response.failure_reason == (
        f"rcl_interfaces/srv/GetParameters has the type hash {type_hash(GetParameters)} here, not RIHS01_0"
    )


def test_humble_asks_for_parameters_only(new_node):
    _, call = new_node(distro="humble")
    assert call("get_parameters", GetParameters, names=("use_sim_time",)) == [GetParameters.Response(values=(YES,))]
    assert call("get_type_description", GetTypeDescription, type_name=GetParameters.TYPE) == []


def test_plain_clients_do_not_see_them(new_node, client_of):
    network, _ = new_node()
    client = client_of(network.session.endpoint)
    listing = client.call("robot1/mjplug/interfaces").json
    assert listing["services"] == []
    assert list(client.session.get("robot1/mjplug/list_parameters", timeout=PATIENCE)) == []
