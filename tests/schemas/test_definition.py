"""Type hashes, `.msg` text and the registry."""

import hashlib
import json
from pathlib import Path
from typing import Annotated, ClassVar

import pytest
from pydantic import Field
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mjplug_schemas import registry
from mjplug_schemas.action import Action
from mjplug_schemas.definition import definition
from mjplug_schemas.errors import DefinitionError, UnknownType
from mjplug_schemas.geometry_msgs import Point
from mjplug_schemas.idl import (
    AtMost,
    Exactly,
    boolean,
    float32,
    float64,
    int8,
    int64,
    sequence,
    string,
    uint8,
    uint8_sequence,
    wstring,
)
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_description, type_hash
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import SetBool, Trigger

VECTORS = Path(__file__).parent / "vectors"
HASHES = json.loads((VECTORS / "rihs01.json").read_text())
HASHES |= json.loads((VECTORS / "actions.json").read_text())["hashes"]
# Its first entry contains the present version, the second one an older version.
HASHES |= next(iter(json.loads((VECTORS / "simulation_interfaces_rihs01.json").read_text()).values()))
# The fields of interfaces that rosbags does not ship, as ROS's own files list them.
ELSEWHERE = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n"
    ),
    "control_msgs/msg/JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "control_msgs/msg/JointComponentTolerance": (
        "uint16 X_AXIS=1\nuint16 Y_AXIS=2\nuint16 Z_AXIS=3\nuint16 TRANSLATION=4\nuint16 ROTATION=5\n"
        "string joint_name\nuint16 component\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
    ),
    "control_msgs/msg/GripperCommand": "float64 position\nfloat64 max_effort\n",
}
JAZZY = get_typestore(Stores.ROS2_JAZZY)
for name, text in ELSEWHERE.items():
    JAZZY.register(get_types_from_msg(text, name))

MESSAGES = [interface for interface in registry.all_types().values() if issubclass(interface, Message)]
SERVICES = [interface for interface in registry.all_types().values() if issubclass(interface, Service)]
SHIPPED = [message for message in MESSAGES if message.TYPE in JAZZY.fielddefs and message.model_fields]

# What rosbags gets wrong: it has another type id for char.
WITH_CHAR = {"std_msgs/msg/Char", "service_msgs/msg/ServiceEventInfo"}


class Everything(Message, package="probe"):
    """All that a .msg file can say.

    In two paragraphs.
    """

    LEAST: ClassVar[int8] = -1
    NAME: ClassVar[string] = "a b"
    RATIO: ClassVar[float32] = 0.5

    flag: boolean = Field(True, description="Whether.\nOr not.")
    ratio: float64 = Field(-1.5)
    word: Annotated[string, AtMost(8)] = Field('say "é"')
    wide: wstring = Field("")
    some: sequence[float64] = Field(())
    few: Annotated[sequence[uint8], AtMost(3)] = Field((1, 2))
    three: Annotated[sequence[float32], Exactly(3)] = Field((0.0, 0.0, 0.5))
    words: Annotated[sequence[Annotated[string, AtMost(4)]], AtMost(2)] = Field(("x",))
    data: Annotated[uint8_sequence, Exactly(2)] = Field(b"\0\7")
    point: Point = Field(Point(), description="Where [m].")
    path: sequence[Point] = Field(())


EVERYTHING = """\
# All that a .msg file can say.
#
# In two paragraphs.

int8 LEAST=-1
string NAME="a b"
float32 RATIO=0.5

# Whether.
# Or not.
bool flag true
float64 ratio -1.5
string<=8 word "say \\"é\\""
wstring wide
float64[] some
uint8[<=3] few [1, 2]
float32[3] three [0.0, 0.0, 0.5]
string<=4[<=2] words ["x"]
uint8[2] data [0, 7]
# Where [m].
geometry_msgs/Point point
geometry_msgs/Point[] path
"""


class WideText(Message, package="example_interfaces"):
    """Has the hash of example_interfaces/msg/WString once it has that name."""

    data: wstring = Field("")


class AddTwoInts(Service, package="example_interfaces"):
    """The service of ROS's tutorials, defined as a plugin would."""

    class Request(Message):
        """Two numbers."""

        a: int64 = Field(0)
        b: int64 = Field(0)

    class Response(Message):
        """Their sum."""

        sum: int64 = Field(0)


def test_every_type_has_the_hash_that_ros_gives_it(interface):
    if interface.TYPE.startswith("mjplug_msgs/"):
        pytest.skip("ROS does not contain this package; its messages are compared with rosbags below")
    if issubclass(interface, Action):
        pytest.skip("test_actions.py compares the hashes of actions")
    if interface.TYPE in HASHES:
        assert type_hash(interface) == HASHES[interface.TYPE]
    else:
        assert type_hash(interface) == JAZZY.hash_rihs01(interface.TYPE)


@pytest.mark.parametrize(
    "part",
    [part for s in SERVICES for part in (s.Request, s.Response) if part.TYPE in HASHES],
    ids=lambda part: part.TYPE,
)
def test_requests_and_responses_have_the_hashes_that_ros_gives_them(part):
    assert type_hash(part) == HASHES[part.TYPE]


@pytest.mark.parametrize("part", [AddTwoInts, AddTwoInts.Request, AddTwoInts.Response], ids=lambda part: part.TYPE)
def test_a_service_defined_elsewhere_has_its_hash(part):
    assert type_hash(part) == HASHES[part.TYPE]


def test_a_wide_string_has_its_hash():
    text = json.dumps(type_description(WideText)).replace("WideText", "WString")
    assert '"type_id": 18' in text
    assert f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}" == HASHES["example_interfaces/msg/WString"]


def test_bounds_and_arrays_have_the_hash_that_rosbags_gives_them():
    class Bounds(Message, package="probe"):
        word: Annotated[string, AtMost(8)] = Field("")
        few: Annotated[sequence[uint8], AtMost(3)] = Field(())
        three: Annotated[sequence[float32], Exactly(3)] = Field((0.0,) * 3)
        words: Annotated[sequence[Annotated[string, AtMost(4)]], AtMost(2)] = Field(())
        points: Annotated[sequence[Point], Exactly(2)] = Field((Point(), Point()))

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(definition(Bounds), Bounds.TYPE))
    assert type_hash(Bounds) == store.hash_rihs01(Bounds.TYPE)


def test_a_definition_is_complete():
    assert definition(Everything) == EVERYTHING


def test_a_service_definition_has_both_halves():
    assert definition(SetBool) == (
        "# Switches something on or off.\n\n"
        "# True switches on, false switches off.\nbool data\n---\n"
        "# Whether the state was set.\nbool success\n# Result as text.\nstring message\n"
    )


@pytest.mark.parametrize("shipped", SHIPPED, ids=lambda shipped: shipped.TYPE)
def test_every_definition_parses_to_what_ros_has(shipped):
    parsed = get_types_from_msg(definition(shipped), shipped.TYPE)[shipped.TYPE]
    constants, fields = JAZZY.fielddefs[shipped.TYPE]
    assert [tuple(constant) for constant in parsed[0]] == [tuple(constant) for constant in constants]
    assert parsed[1] == fields


def test_definitions_parse_to_types_with_our_hashes():
    store = get_typestore(Stores.EMPTY)
    parsed = {}
    for message in MESSAGES:
        parsed |= get_types_from_msg(definition(message), message.TYPE)
    store.register(parsed)
    hashes = {message.TYPE: type_hash(message) for message in MESSAGES if message.TYPE not in WITH_CHAR}
    assert hashes == {name: store.hash_rihs01(name) for name in hashes}
    assert len(hashes) > 70


def test_every_field_is_described(message):
    for name, field in message.model_fields.items():
        assert field.description, name


def test_types_are_found_by_name():
    assert registry.find("std_msgs/msg/String") is String
    assert registry.find("std_srvs/srv/Trigger") is Trigger
    assert registry.find("std_srvs/srv/Trigger_Request") is Trigger.Request
    assert registry.find("std_srvs/srv/Trigger_Response") is Trigger.Response
    for name, interface in registry.all_types().items():
        assert registry.find(name) is interface
        assert name == interface.TYPE


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("std_msgs/String", ", did you mean 'std_msgs/msg/String'?"),
        ("std_msgs/msg/Strin", ", did you mean 'std_msgs/msg/String'?"),
        ("String", ", did you mean 'std_msgs/msg/String'?"),
        ("strin", ", did you mean 'std_msgs/msg/String'?"),
        ("Nothing of the kind", ""),
        ("", ""),
        ("std_msgs/msg/String_Request", ", did you mean 'std_msgs/msg/String'?"),
    ],
)
def test_an_unknown_type_is_explained(name, hint):
    with pytest.raises(KeyError) as caught:
        registry.find(name)
    assert isinstance(caught.value, UnknownType)
    assert str(caught.value) == (
        f"unknown type {name!r}{hint}; known packages: action_msgs, builtin_interfaces, control_msgs, diagnostic_msgs, "
        "geometry_msgs, mjplug_msgs, mujoco_ros2_control_msgs, nav_msgs, rcl_interfaces, rosgraph_msgs, sensor_msgs, "
        "service_msgs, simulation_interfaces, std_msgs, std_srvs, tf2_msgs, trajectory_msgs, "
        "type_description_interfaces, unique_identifier_msgs, visualization_msgs"
    )


def test_a_type_from_elsewhere_can_be_added_once():
    class Added(Message, package="probe"):
        """A first one."""

    registry.add(Added)
    registry.add(Added)
    assert registry.find("probe/msg/Added") is Added

    class Other(Message, package="probe"):
        """A second one of the same name."""

    Other.TYPE = "probe/msg/Added"
    with pytest.raises(DefinitionError, match=r"^probe/msg/Added is already defined by .*test_definition$"):
        registry.add(Other)
