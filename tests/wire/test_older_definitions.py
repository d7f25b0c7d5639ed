"""ROS 2 nodes with simulation_interfaces 1.x call services of a server with version 2."""

import json
import queue
from pathlib import Path

import pytest
import zenoh
from waits import TIMEOUT
from wire.ros_peer import WHO

from mjplug.contracts.transport import ServiceName
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug_schemas import simulation_interfaces as new
from mjplug_schemas import simulation_interfaces_1 as old
from mjplug_schemas.rihs01 import type_hash

SAMPLES = json.loads((Path(__file__).parents[1] / "schemas" / "vectors" / "simulation_interfaces_cdr.json").read_text())
LISTED = (
    new.Spawnable(entity_resource=new.Resource(uri="a.xml"), description="d"),
    new.Spawnable(entity_resource=new.Resource(resource_string="<mujoco/>")),
)
RESPONSES = {
    "SetEntityState": new.SetEntityState.Response(result=new.Result(result=1)),
    "SpawnEntity": new.SpawnEntity.Response(result=new.Result(result=1), entity_name="cup"),
    "LoadWorld": new.LoadWorld.Response(result=new.Result(result=1)),
    "GetSpawnables": new.GetSpawnables.Response(result=new.Result(result=1), spawnables=LISTED),
}


def ask(network, client, name, definition, payload, chunk=None):
    """Sends a request with the hash of a definition; returns the decoded request and the bytes of the response."""
    calls, replies = queue.SimpleQueue(), queue.SimpleQueue()
    present = getattr(new, name)
    network.open_service(ServiceName(f"/{name}", present), calls.put)
    client.settle()
    key = f"0/{name}/simulation_interfaces::srv::dds_::{name}_/{chunk or type_hash(definition)}"
    client.session.get(
        key,
        replies.put,
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        payload=payload,
        attachment=Attachment(1, 1, WHO).to_bytes(),
        timeout=TIMEOUT,
    )
    call = calls.get(timeout=TIMEOUT)
    call.respond(RESPONSES[name])
    return call.request, bytes(replies.get(timeout=TIMEOUT).ok.payload)


def sample(version, type_name):
    (found,) = (s for s in SAMPLES if s["definitions"] == version and s["type"] == type_name)
    return bytes.fromhex(found["cdr"])


@pytest.fixture
def network(new_ros_network):
    return new_ros_network()


def test_a_state_without_flags_sets_everything(network, client):
    request, reply = ask(
        network, client, "SetEntityState", old.SetEntityState, sample("1.6.1", "SetEntityState_Request")
    )
    assert (request.set_pose, request.set_twist, request.set_acceleration) == (True, True, True)
    assert (request.entity, request.state.twist.linear.x) == ("cup", 0.1)
    assert new.SetEntityState.Response.from_cdr(reply).result.result == 1


def test_a_request_of_version_2_keeps_its_flags(network, client):
    request, _ = ask(network, client, "SetEntityState", new.SetEntityState, sample("2.1.0", "SetEntityState_Request"))
    assert (request.set_pose, request.set_twist, request.set_acceleration) == (True, True, False)


@pytest.mark.parametrize("definition", [old, new], ids=["1", "2"])
def test_a_model_to_spawn_has_the_same_bytes_in_both_versions(network, client, definition):
    version = "1.6.1" if definition is old else "2.1.0"
    payload = sample(version, "SpawnEntity_Request")
    request, reply = ask(network, client, "SpawnEntity", definition.SpawnEntity, payload)
    assert (request.name, request.entity_resource.uri, request.initial_pose.pose.position.y) == (
        "cup", "file:///cup.xml", -2.0,
    )  # fmt: skip
    assert new.SpawnEntity.Response.from_cdr(reply).entity_name == "cup"


def test_spawnable_models_are_listed_in_the_form_of_version_1(network, client):
    _, reply = ask(network, client, "GetSpawnables", old.GetSpawnables, old.GetSpawnables.Request().to_cdr())
    listed = old.GetSpawnables.Response.from_cdr(reply).spawnables
    assert [(item.uri, item.description) for item in listed] == [("a.xml", "d")]
    expected = sample("1.6.1", "GetSpawnables_Response")
    assert old.GetSpawnables.Response.from_cdr(expected).to_cdr().hex().rstrip("0") == expected.hex().rstrip("0")


def test_a_world_of_version_1_is_read(network, client):
    request, _ = ask(network, client, "LoadWorld", old.LoadWorld, sample("1.6.1", "LoadWorld_Request"))
    assert (request.world_resource.uri, request.ignore_missing_or_unsupported_assets) == ("w.xml", True)


def test_nodes_of_humble_have_version_1(new_ros_network, client_of):
    network = new_ros_network(distro="humble")
    client = client_of(network.session.endpoint)
    payload = sample("1.6.1", "SetEntityState_Request")
    request, _ = ask(network, client, "SetEntityState", old.SetEntityState, payload, "TypeHashNotSupported")
    assert request.set_twist
