"""A server's parameters, as ROS has them."""

from typing import Any, Protocol

import zenoh

from mjplug.client.errors import RequestRefused
from mjplug.wire.encoding import encoding_of
from mjplug_schemas.message import Message
from mjplug_schemas.rcl_interfaces import GetParameters, Parameter, ParameterType, ParameterValue, SetParameters


class Caller(Protocol):
    """Calls services; `mjplug.client.Client` does."""

    def call(self, service: str, request: Message, /) -> Any:
        """Returns the response of a service."""


Scalar = bool | int | float | str

_FIELDS = {
    ParameterType.PARAMETER_BOOL: "bool_value",
    ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value",
    ParameterType.PARAMETER_STRING: "string_value",
}

_TYPES: dict[type[Any], int] = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    float: ParameterType.PARAMETER_DOUBLE,
    str: ParameterType.PARAMETER_STRING,
}

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
    kind = _TYPES[type(value)]
    parameter = Parameter(name=name, value=ParameterValue(**{"type": kind, _FIELDS[kind]: value}))
    service = f"{server}/set_parameters"
    (result,) = client.call(service, SetParameters.Request(parameters=(parameter,))).results
    if not result.successful:
        raise RequestRefused(service, result.reason, result)
