"""The server's parameters, in the six services that ROS 2 tools know: `ros2 param list`, `get`, `set` and so on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from mjplug.config.settings import Settings
from mjplug.errors import RequestError, did_you_mean, quoted
from mjplug.limits import FASTEST, SLOWEST
from mjplug.near_names import Names
from mjplug.physics.loop import Loop
from mjplug.physics.pacing import Speed
from mjplug.plugin import Call, Host
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

Apply = Callable[[], None]

_NOT_SET = ParameterValue()
_FIELDS: Final[dict[type[Any], tuple[int, str]]] = {
    bool: (ParameterType.PARAMETER_BOOL, "bool_value"),
    int: (ParameterType.PARAMETER_INTEGER, "integer_value"),
    float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
    str: (ParameterType.PARAMETER_STRING, "string_value"),
}
_SCALARS: Final = dict(_FIELDS.values())


@dataclass(frozen=True, slots=True)
class Live:
    """One parameter.

    Attributes:
        read: Returns its value at this moment.
        plan: Checks a new value and returns what sets it, or raises a `RequestError` with the reason against it.
        description: What it is, with its unit.
        changeable: Whether `plan` accepts anything but the present value.
    """

    read: Callable[[], Scalar]
    plan: Callable[[Scalar | None], Apply]
    description: str
    changeable: bool = False


def offer(host: Host, loop: Loop, settings: Settings) -> None:
    """Declares the services. `sim.speed` can be set, everything else can be read."""
    services = ParameterServices(parameters(loop, settings))
    for below, (kind, handler) in services.handlers.items():
        host.create_service(kind, f"~/{below}", _service(handler))


def parameters(loop: Loop, settings: Settings) -> dict[str, Live]:
    """Returns the parameters of a server by name."""
    described = type(settings.sim).model_fields
    found = {
        "use_sim_time": fixed(True, "Always true: the server is where the time comes from."),
        "model": fixed(settings.model, "The model, as the configuration names it."),
    }
    for name, value in settings.sim.model_dump(exclude={"speed", "paused", "initial_positions"}).items():
        # ROS has no mappings for parameters.
        if isinstance(value, Scalar):
            found[f"sim.{name}"] = fixed(value, described[name].description or "")
    for joint, position in settings.sim.initial_positions.items():
        found[f"sim.initial_positions.{joint}"] = fixed(position, described["initial_positions"].description or "")
    found["sim.paused"] = Live(
        lambda: loop.paused,
        lambda value: _unchanged(value, loop.paused, "it is set with the service ~/set_pause"),
        "Whether simulated time stands still.",
    )

    def plan_speed(value: Scalar | None) -> Apply:
        speed = _speed(value)
        return lambda: loop.set_speed(speed)

    found["sim.speed"] = Live(lambda: loop.pacer.speed, plan_speed, described["speed"].description or "", True)
    return found


def fixed(value: Scalar, description: str = "") -> Live:
    """Returns a parameter that stays as it is."""
    return Live(
        lambda: value, lambda new: _unchanged(new, value, "it comes from the configuration of the server"), description
    )


class ParameterServices:
    """What the six services answer.

    Args:
        parameters: The parameters by name.
    """

    def __init__(self, parameters: Mapping[str, Live]) -> None:
        self._parameters = dict(sorted(parameters.items()))
        self._names = Names(parameters)

    @property
    def handlers(self) -> Mapping[str, tuple[type[Service], Callable[[Any], Message]]]:
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
        return DescribeParameters.Response(descriptors=tuple(map(self._descriptor, request.names)))

    def _get(self, request: GetParameters.Request) -> GetParameters.Response:
        return GetParameters.Response(values=tuple(map(self._value, request.names)))

    def _types(self, request: GetParameterTypes.Request) -> GetParameterTypes.Response:
        return GetParameterTypes.Response(types=bytes(self._value(name).type for name in request.names))

    def _list(self, request: ListParameters.Request) -> ListParameters.Response:
        names = tuple(name for name in self._parameters if _is_below(name, request.prefixes, request.depth))
        prefixes = dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)
        return ListParameters.Response(result=ListParametersResult(names=names, prefixes=tuple(prefixes)))

    def _set(self, request: SetParameters.Request) -> SetParameters.Response:
        results = []
        for parameter in request.parameters:
            try:
                self._plan(parameter)()
            except RequestError as error:
                results.append(SetParametersResult(successful=False, reason=str(error)))
            else:
                results.append(SetParametersResult(successful=True))
        return SetParameters.Response(results=tuple(results))

    def _set_atomically(self, request: SetParametersAtomically.Request) -> SetParametersAtomically.Response:
        try:
            plans = [self._plan(parameter) for parameter in request.parameters]
        except RequestError as error:
            result = SetParametersResult(successful=False, reason=str(error))
        else:
            for apply in plans:
                apply()
            result = SetParametersResult(successful=True)
        return SetParametersAtomically.Response(result=result)

    def _plan(self, parameter: Parameter) -> Apply:
        name, live = parameter.name, self._parameters.get(parameter.name)
        if live is None:
            raise RequestError(
                f"there is no parameter {quoted(name)}{did_you_mean(name, self._names)}; "
                f"there are {', '.join(self._parameters)}"
            )
        try:
            return live.plan(_scalar(parameter.value))
        except RequestError as error:
            raise RequestError(f"parameter {name!r}: {error}") from None

    def _value(self, name: str) -> ParameterValue:
        live = self._parameters.get(name)
        return _NOT_SET if live is None else parameter_value(live.read())

    def _descriptor(self, name: str) -> ParameterDescriptor:
        live = self._parameters.get(name)
        if live is None:
            return ParameterDescriptor(name=name)
        return ParameterDescriptor(
            name=name,
            type=self._value(name).type,
            description=live.description,
            read_only=not live.changeable,
            # `max` and 2.0 are of different types.
            dynamic_typing=live.changeable,
        )


def parameter_value(value: Scalar) -> ParameterValue:
    """Returns a value as ROS has it."""
    kind, field = _FIELDS[type(value)]
    return ParameterValue(**{"type": kind, field: value})


def _scalar(value: ParameterValue) -> Scalar | None:
    """Returns a value as Python has it; None for lists and for nothing, which no parameter here is."""
    field = _SCALARS.get(value.type)
    scalar: Scalar | None = None if field is None else getattr(value, field)
    return scalar


def _unchanged(new: Scalar | None, value: Scalar, way_out: str) -> Apply:
    """Accepts what changes nothing: launch files set `use_sim_time` on every node."""
    if type(new) is not type(value) or new != value:
        raise RequestError(f"it is read-only; {way_out}")
    return lambda: None


def _speed(value: Scalar | None) -> Speed:
    if value == "max":
        return "max"
    if isinstance(value, int | float) and not isinstance(value, bool) and SLOWEST <= value <= FASTEST:
        return float(value)
    shown = quoted(value) if isinstance(value, str) else repr(value)
    raise RequestError(f"it must be a number from {SLOWEST:g} to {FASTEST:g}, or 'max', not {shown}")


def _service(handler: Callable[[Any], Message]) -> Callable[[Any, Call], Message]:
    return lambda request, call: handler(request)


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
