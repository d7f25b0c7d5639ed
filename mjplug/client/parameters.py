"""A server's parameters, through the services that ROS has for them."""

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
    """Calls services; `mjplug.client.Client` does."""

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
"""The ROS types of a Python type: of one value, and of a list of them."""

NAMES = (
    "model", "sim.paused", "sim.speed", "sim.keyframe", "sim.seed", "sim.clock_rate", "sim.on_divergence",
)  # fmt: skip
"""The parameters that every server has."""

_QUERY_TIMEOUT = 2.0
"""How long to wait for the answer [s]; it comes between two steps."""


def read(session: zenoh.Session, server: str) -> dict[str, Scalar]:
    """Returns the parameters of a server by name; none if it does not answer."""
    request = GetParameters.Request(names=NAMES)
    values: dict[str, Scalar] = {}
    for reply in session.get(
        f"{server.removeprefix('/')}/get_parameters",
        payload=request.to_cdr(),
        encoding=encoding_of("cdr", GetParameters.Request),
        timeout=_QUERY_TIMEOUT,
    ):
        if reply.ok is not None:
            told = GetParameters.Response.from_cdr(reply.ok.payload.to_bytes()).values
            values |= {name: scalar(value) for name, value in zip(NAMES, told, strict=False) if value.type in _FIELDS}
    return values


def scalar(value: ParameterValue) -> Any:
    """Returns the value in ROS's record of a parameter."""
    return getattr(value, _FIELDS[value.type])


@dataclass(frozen=True, slots=True)
class Found:
    """A parameter's value.

    Attributes:
        type: Its type, one of the constants of ParameterType.
        value: A bool, number or text, a tuple of them, or bytes.
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
    """Returns what stands before the value of a parameter: `Double value is:`."""
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
    """Sets parameters, each on its own.

    An integer is sent as a double where the parameter is one.

    Args:
        client: A client on the network.
        server: The server's full name.
        values: New values by name.

    Returns:
        What the server says to each.

    Raises:
        WrongTypeError: A value has no type that a parameter can have.
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
    """Returns ROS's record of a value.

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
            f"parameter {name!r}: {value!r} is not a bool, a number, a string, or a list with values of one of them"
        )
    if not kinds:
        # An empty list does not tell its type.
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
        RequestRefused: The server does not want it.
    """
    (result,) = set_values(client, server, {name: value})
    if not result.successful:
        raise RequestRefused(f"{server}/set_parameters", result.reason, result)
