"""simulation_interfaces 2.1 and 1.x: hashes and CDR against those of ROS's own tools."""

import json
from pathlib import Path

import pytest

from mjplug_schemas import registry, simulation_interfaces_1
from mjplug_schemas import simulation_interfaces as current
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.simulation_interfaces import SpawnEntities, SpawnEntity, SpawnEntityMessage, StepSimulation

FOLDER = Path(__file__).parent / "vectors"
HASHES = list(json.loads((FOLDER / "simulation_interfaces_rihs01.json").read_text()).values())
SAMPLES = json.loads((FOLDER / "simulation_interfaces_cdr.json").read_text())
OLD = {
    interface.TYPE: interface
    for interface in vars(simulation_interfaces_1).values()
    if isinstance(interface, type)
    and issubclass(interface, Message | Service)
    and interface.__module__ == simulation_interfaces_1.__name__
}


def _parts(types):
    for name, interface in types.items():
        yield name, interface
        if issubclass(interface, Service):
            yield f"{name}_Request", interface.Request
            yield f"{name}_Response", interface.Response


@pytest.mark.parametrize("name", [n for n in HASHES[0] if not n.endswith("_Event")])
def test_the_hashes_of_version_2_are_those_of_ros(name):
    assert type_hash(registry.find(name)) == HASHES[0][name]


def test_all_22_services_and_15_messages_are_there():
    names = [name for name in registry.all_types() if name.startswith("simulation_interfaces/")]
    assert len([name for name in names if "/srv/" in name]) == 22
    assert len([name for name in names if "/msg/" in name]) == 15
    assert {name for name in HASHES[0] if name.count("_") == 1} == set(names)


def test_the_hashes_of_version_1_are_those_of_ros():
    parts = dict(_parts(OLD))
    for name, value in HASHES[1].items():
        if not name.endswith("_Event"):
            assert type_hash(parts[name]) == value, name


def _sample_type(sample):
    name = sample["type"]
    service, _, part = name.partition("_")
    interface = getattr(simulation_interfaces_1 if sample["definitions"].startswith("1") else current, service)
    return getattr(interface, part)


@pytest.mark.parametrize(
    "sample",
    [sample for sample in SAMPLES if not sample["type"].startswith("SimulateSteps")],
    ids=lambda sample: f"{sample['type']} {sample['definitions']}",
)
def test_samples_have_the_bytes_of_ros(sample):
    kind = _sample_type(sample)
    message = kind.from_json(json.dumps(sample["value"]))
    # A decoder accepts the padding at the end, which some versions write and others do not.
    assert message.to_cdr().hex().rstrip("0") == sample["cdr"].rstrip("0")
    assert kind.from_cdr(bytes.fromhex(sample["cdr"])) == message


def test_a_message_and_a_service_have_the_same_name():
    assert registry.find("simulation_interfaces/msg/SpawnEntity") is SpawnEntityMessage
    assert registry.find("simulation_interfaces/srv/SpawnEntity") is SpawnEntity
    request = SpawnEntities.Request(spawn_requests=[SpawnEntityMessage(name="a"), SpawnEntityMessage(name="b")])
    assert SpawnEntities.Request.from_cdr(request.to_cdr()) == request


def test_an_empty_request_means_one_step():
    assert StepSimulation.Request.from_json("{}").steps == 1
