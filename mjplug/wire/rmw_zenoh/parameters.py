"""The parameters that ROS 2 tools read from the server's node. All of them are read-only."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from mjplug_schemas.message import Message, Service
from mjplug_schemas.rcl_interfaces import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    ListParametersResult,
    Parameter,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
    SetParameters,
    SetParametersAtomically,
    SetParametersResult,
)

Scalar = bool | int | float | str

Handler = Callable[[Any], Message]
"""From a request to the response of the same service."""

_NOT_SET = ParameterValue()
_FIELDS: Final[dict[type[Any], tuple[int, str]]] = {
    bool: (ParameterType.PARAMETER_BOOL, "bool_value"),
    int: (ParameterType.PARAMETER_INTEGER, "integer_value"),
    float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
    str: (ParameterType.PARAMETER_STRING, "string_value"),
}


def parameter_value(value: Scalar) -> ParameterValue:
    """Returns a value as ROS has it."""
    kind, field = _FIELDS[type(value)]
    return ParameterValue(**{"type": kind, field: value})


class ParameterServices:
    """What the six parameter services answer.

    Args:
        parameters: Their values by their names.
    """

    def __init__(self, parameters: Mapping[str, Scalar]) -> None:
        self._values = {name: parameter_value(value) for name, value in sorted(parameters.items())}

    @property
    def handlers(self) -> Mapping[str, tuple[type[Service], Handler]]:
        """The services by their names below that of the node."""
        return {
            "describe_parameters": (DescribeParameters, self._describe),
            "get_parameters": (GetParameters, self._get),
            "get_parameter_types": (GetParameterTypes, self._types),
            "list_parameters": (ListParameters, self._list),
            "set_parameters": (SetParameters, self._set),
            "set_parameters_atomically": (SetParametersAtomically, self._set_atomically),
        }

    def _describe(self, request: DescribeParameters.Request) -> DescribeParameters.Response:
        return DescribeParameters.Response(
            descriptors=tuple(
                ParameterDescriptor(name=name, type=self._value(name).type, read_only=name in self._values)
                for name in request.names
            )
        )

    def _get(self, request: GetParameters.Request) -> GetParameters.Response:
        return GetParameters.Response(values=tuple(self._value(name) for name in request.names))

    def _types(self, request: GetParameterTypes.Request) -> GetParameterTypes.Response:
        return GetParameterTypes.Response(types=bytes(self._value(name).type for name in request.names))

    def _list(self, request: ListParameters.Request) -> ListParameters.Response:
        names = tuple(name for name in self._values if _is_below(name, request.prefixes, request.depth))
        prefixes = dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)
        return ListParameters.Response(result=ListParametersResult(names=names, prefixes=tuple(prefixes)))

    def _set(self, request: SetParameters.Request) -> SetParameters.Response:
        return SetParameters.Response(results=tuple(self._try(parameter) for parameter in request.parameters))

    def _set_atomically(self, request: SetParametersAtomically.Request) -> SetParametersAtomically.Response:
        results = (self._try(parameter) for parameter in request.parameters)
        worst = next((result for result in results if not result.successful), SetParametersResult(successful=True))
        return SetParametersAtomically.Response(result=worst)

    def _try(self, parameter: Parameter) -> SetParametersResult:
        """Accepts what changes nothing: launch files set `use_sim_time` on every node."""
        if parameter.name not in self._values:
            reason = f"there is no parameter {parameter.name!r}; there are {', '.join(self._values)}"
        elif self._values[parameter.name] != parameter.value:
            reason = f"parameter {parameter.name!r} is read-only; it comes from the configuration of the server"
        else:
            return SetParametersResult(successful=True)
        return SetParametersResult(successful=False, reason=reason)

    def _value(self, name: str) -> ParameterValue:
        return self._values.get(name, _NOT_SET)


def _is_below(name: str, prefixes: Sequence[str], depth: int) -> bool:
    """Whether a name is in one of the groups, at most `depth` levels down; depth 0 is no limit."""
    if not prefixes:
        return depth == 0 or name.count(".") < depth
    for prefix in prefixes:
        if name == prefix:
            return True
        if name.startswith(f"{prefix}."):
            below = name.removeprefix(f"{prefix}.")
            if depth == 0 or below.count(".") < depth:
                return True
    return False
