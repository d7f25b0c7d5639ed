"""Random messages of any type, and rosbags as an independent codec."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mjplug_schemas.action import Action
from mjplug_schemas.definition import definition
from mjplug_schemas.idl import Primitive
from mjplug_schemas.message import Message
from mjplug_schemas.registry import all_types
from mjplug_schemas.shape import fields

# The same examples each time: a test that fails now and then is a test nobody believes.
settings.register_profile(
    "schemas", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
settings.load_profile("schemas")

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)
SCALARS = {
    "bool": st.booleans(),
    "string": TEXT,
    "wstring": TEXT,
    "float64": st.floats(),
    "float32": st.floats(width=32),
}
DTYPES = {"char": "uint8", "byte": "int8"}


def plain_messages():
    """All registered messages, requests, responses, and messages that belong to actions, by type name."""
    found = {}
    for name, interface in all_types().items():
        if issubclass(interface, Message):
            found[name] = interface
        elif issubclass(interface, Action):
            found |= {part: cls for part, cls in interface.derived().items() if issubclass(cls, Message)}
        else:
            found |= {part.TYPE: part for part in (interface.Request, interface.Response)}
    return found


def messages(message):
    """Random messages of a type."""
    return st.builds(message, **{field.name: _values(field) for field in fields(message)})


def _values(field):
    if not isinstance(field.element, Primitive):
        one = messages(field.element)
    elif field.element.name in SCALARS:
        one = SCALARS[field.element.name]
        if field.text_bound:
            one = one.filter(lambda text: len(text.encode()) <= field.text_bound)
    else:
        low, high = field.element.limits
        one = st.integers(low, high) | st.sampled_from([low, high])
    if field.kind == "one":
        return one
    low, high = (field.count, field.count) if field.kind == "array" else (0, min(field.count or 4, 4))
    return st.binary(min_size=low, max_size=high) if field.octets else st.lists(one, min_size=low, max_size=high)


def same(left, right):
    """Whether two messages or values are equal, NaN being equal to NaN."""
    if isinstance(left, Message):
        return type(left) is type(right) and all(
            same(getattr(left, name), getattr(right, name)) for name in type(left).model_fields
        )
    if isinstance(left, tuple):
        return isinstance(right, tuple) and len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, float) and math.isnan(left):
        return isinstance(right, float) and math.isnan(right)
    return type(left) is type(right) and left == right


class Rosbags:
    """rosbags with its own definitions of ROS's types, and ours of the types that it does not have."""

    def __init__(self):
        self.store = get_typestore(Stores.ROS2_JAZZY)
        for message in plain_messages().values():
            self.add(message)

    def add(self, message):
        if message.TYPE in self.store.fielddefs:
            # Registration takes milliseconds, and some tests add a type in each of their examples.
            return
        # rosbags would turn pkg/srv/X into pkg/srv/msg/X, so the text is parsed under another name.
        constants, parsed = get_types_from_msg(definition(message), "parsed/msg/Parsed")["parsed/msg/Parsed"]
        self.store.register({message.TYPE: (constants, [(name, _of_action(kind)) for name, kind in parsed])})

    def encode(self, message, little_endian=True):
        """The message in CDR, by rosbags."""
        foreign = self._foreign(message, message.TYPE)
        return bytes(self.store.serialize_cdr(foreign, message.TYPE, little_endian=little_endian))

    def decode(self, message, buffer):
        """The message that rosbags reads, as one of ours."""
        return self._ours(message, self.store.deserialize_cdr(buffer, message.TYPE))

    def _foreign(self, message, type_name):
        values = {}
        for name, (kind, what) in self.store.fielddefs[type_name][1]:
            own = "structure_needs_at_least_one_member" if not type(message).model_fields else name
            value = getattr(message, own, 0)
            if kind == Nodetype.BASE:
                values[name] = _signed(value) if what[0] == "byte" else value
            elif kind == Nodetype.NAME:
                values[name] = self._foreign(value, what)
            else:
                values[name] = self._elements(value, *what[0])
        return SimpleNamespace(**values)

    def _elements(self, values, kind, what):
        if kind == Nodetype.NAME:
            return [self._foreign(value, what) for value in values]
        if what[0] == "string":
            return list(values)
        if isinstance(values, bytes):
            return np.frombuffer(values, DTYPES.get(what[0], what[0]))
        return np.array(values, what[0])

    def _ours(self, message, foreign):
        values = {}
        for field in fields(message):
            value = getattr(foreign, field.name)
            if isinstance(value, np.ndarray):
                value = value.tobytes() if field.octets else value.tolist()
            elif field.kind != "one" and not isinstance(field.element, Primitive):
                value = [self._ours(field.element, element) for element in value]
            elif not isinstance(field.element, Primitive):
                value = self._ours(field.element, value)
            elif field.element.name == "byte":
                value &= 0xFF
            values[field.name] = value
        return message(**values)


def _of_action(kind):
    """The type of a field; rosbags takes a part of an action, such as pkg/action/X_Goal, for a message."""
    node, name = kind
    if node == Nodetype.NAME and name.replace("/msg/", "/action/") in plain_messages():
        return node, name.replace("/msg/", "/action/")
    return kind


def _signed(octet):
    return octet - 256 if octet > 127 else octet


@pytest.fixture(scope="session")
def rosbags():
    return Rosbags()


@pytest.fixture(scope="session", name="messages")
def messages_fixture():
    """`messages(cls)`: random messages of a type."""
    return messages


@pytest.fixture(scope="session", name="same")
def same_fixture():
    """`same(a, b)`: equality that takes NaN as equal to NaN."""
    return same


def pytest_generate_tests(metafunc):
    """A test that takes `message` runs for every message type, one that takes `interface` for services too."""
    if "message" in metafunc.fixturenames:
        found = plain_messages()
        metafunc.parametrize("message", found.values(), ids=found.keys())
    if "interface" in metafunc.fixturenames:
        found = all_types()
        metafunc.parametrize("interface", found.values(), ids=found.keys())
