"""The parameters of a server, through ROS's parameter services."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import zenoh

from mjplug.client.errors import RequestRefused, UnknownNameError, WrongTypeError
from mjplug.wire.encoding import encoding_of
from mjplug_schemas.message import Message
from mjplug_schemas.rcl_interfaces import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    Parameter,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
    SetParameters,
    SetParametersResult,
)


class Caller(Protocol):
    """Calls services, like `mjplug.client.Client`."""

    def call(self, service: str, request: Message, /) -> Any:
        """Returns the response of a service."""


Scalar = bool | int | float | str

_FIELDS: Final = {
    ParameterType.PARAMETER_BOOL: "bool_value",
    ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value",
    ParameterType.PARAMETER_STRING: "string_value",
    ParameterType.PARAMETER_BYTE_ARRAY: "byte_array_value",
    ParameterType.PARAMETER_BOOL_ARRAY: "bool_array_value",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer_array_value",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double_array_value",
    ParameterType.PARAMETER_STRING_ARRAY: "string_array_value",
}

_TYPES: Final[Mapping[type[Any], tuple[int, int]]] = {
    bool: (ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_BOOL_ARRAY),
    int: (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_INTEGER_ARRAY),
    float: (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY),
    str: (ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_STRING_ARRAY),
}
"""By Python type: the ROS types of a single value and of a list."""

NAMES = (
    "model", "sim.paused", "sim.speed", "sim.keyframe", "sim.seed", "sim.clock_rate", "sim.on_divergence",
)  # fmt: skip
"""The common parameters of all servers."""

_QUERY_TIMEOUT = 2.0
"""Timeout of the query [s]; a server answers between two steps."""


def read(session: zenoh.Session, server: str) -> dict[str, Scalar]:
    """Returns the common parameters of a server by name; none if it does not answer."""
    request = GetParameters.Request(names=NAMES)
    values: dict[str, Scalar] = {}
    for reply in session.get(
        f"{server.removeprefix('/')}/get_parameters",
        payload=request.to_cdr(),
        encoding=encoding_of("cdr", GetParameters.Request),
        timeout=_QUERY_TIMEOUT,
    ):
        if reply.ok is not None:
            found = GetParameters.Response.from_cdr(reply.ok.payload.to_bytes()).values
            values |= {name: scalar(value) for name, value in zip(NAMES, found, strict=False) if value.type in _FIELDS}
    return values


def scalar(value: ParameterValue) -> Any:
    """Returns the value in a ParameterValue."""
    return getattr(value, _FIELDS[value.type])


@dataclass(frozen=True, slots=True)
class Found:
    """A parameter's value.

    Attributes:
        type: Its type, one of the constants of ParameterType.
        value: A bool, number or string, a tuple of them, or bytes.
    """

    type: int
    value: Any


def type_name(kind: int) -> str:
    """Returns the name of a parameter's type: `double`, `string array`."""
    field = _FIELDS.get(kind)
    if field is None:
        return "not set"
    return field.removesuffix("_value").replace("_", " ").replace("bool", "boolean")


def label(kind: int) -> str:
    """Returns the text before the value of a parameter: `Double value is:`."""
    name = type_name(kind)
    one = not name.endswith(" array")
    return f"{name.removesuffix(' array').capitalize()} {'value is' if one else 'values are'}:"


def names_of(client: Caller, server: str, prefixes: Sequence[str] = ()) -> list[str]:
    """Returns the names of a server's parameters, in alphabetical order.

    Args:
        client: A client on its network.
        server: Its full name.
        prefixes: Only names below these.
    """
    request = ListParameters.Request(prefixes=tuple(prefixes))
    return sorted(client.call(f"{server}/list_parameters", request).result.names)


def values_of(client: Caller, server: str, names: Sequence[str]) -> list[Found]:
    """Returns the values of parameters.

    Args:
        client: A client on the network.
        server: The server's full name.
        names: The names of the parameters.

    Raises:
        UnknownNameError: The server has no parameter of one of these names.
    """
    response = client.call(f"{server}/get_parameters", GetParameters.Request(names=tuple(names)))
    for name, value in zip(names, response.values, strict=True):
        if value.type not in _FIELDS:
            raise UnknownNameError("parameter", name, names_of(client, server))
    return [Found(value.type, scalar(value)) for value in response.values]


def describe(client: Caller, server: str, names: Sequence[str]) -> Sequence[ParameterDescriptor]:
    """Returns the descriptions of parameters.

    Args:
        client: A client on the network.
        server: The server's full name.
        names: The names of the parameters.

    Raises:
        UnknownNameError: The server has no parameter of one of these names.
    """
    response = client.call(f"{server}/describe_parameters", DescribeParameters.Request(names=tuple(names)))
    described: Sequence[ParameterDescriptor] = response.descriptors
    for each in described:
        if each.type not in _FIELDS:
            raise UnknownNameError("parameter", each.name, names_of(client, server))
    return described


def set_values(client: Caller, server: str, values: Mapping[str, Any]) -> Sequence[SetParametersResult]:
    """Sets parameters independently of each other.

    An integer is sent as a double if the parameter is a double.

    Args:
        client: A client on the network.
        server: The server's full name.
        values: New values by name.

    Returns:
        The result for each parameter.

    Raises:
        WrongTypeError: A parameter cannot have a value of this type.
    """
    request = GetParameters.Request(names=tuple(values))
    present = client.call(f"{server}/get_parameters", request).values
    parameters = tuple(
        Parameter(name=name, value=_record(name, value, now.type))
        for (name, value), now in zip(values.items(), present, strict=True)
    )
    response = client.call(f"{server}/set_parameters", SetParameters.Request(parameters=parameters))
    results: Sequence[SetParametersResult] = response.results
    return results


def _record(name: str, value: Any, present: int) -> ParameterValue:
    """Returns a value as a ParameterValue.

    Args:
        name: The parameter.
        value: The value.
        present: The type that the parameter has.
    """
    several = isinstance(value, list | tuple)
    elements = list(value) if several else [value]
    doubles = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY)
    kinds = {type(element) for element in elements}
    if kinds <= {int, float} and (present in doubles or float in kinds):
        elements, kinds = [float(element) for element in elements], {float}
    if len(kinds) > 1 or not kinds <= _TYPES.keys():
        raise WrongTypeError(
            f"parameter {name!r}: {value!r} is not a bool, a number, a string, or a list of values of one type"
        )
    if not kinds:
        # An empty list does not determine its type.
        kind = present if present in _FIELDS else ParameterType.PARAMETER_STRING_ARRAY
    else:
        kind = _TYPES[kinds.pop()][several]
    return ParameterValue(**{"type": kind, _FIELDS[kind]: tuple(elements) if several else elements[0]})


def set_one(client: Caller, server: str, name: str, value: Scalar) -> None:
    """Sets a parameter of a server.

    Args:
        client: A client on its network.
        server: Its full name.
        name: The parameter's name.
        value: Its new value.

    Raises:
        RequestRefused: The server refuses the value.
    """
    (result,) = set_values(client, server, {name: value})
    if not result.successful:
        raise RequestRefused(f"{server}/set_parameters", result.reason, result)
