"""The server's parameters, served by the six parameter services of a ROS 2 node, for tools such as `ros2 param`."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from mjplug.config.settings import Settings
from mjplug.contracts.parameters import ChangeableParameters, ParameterGroup, Scalar
from mjplug.errors import RequestError, UnknownName, quoted
from mjplug.limits import MAX_SPEED, MIN_SPEED
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

Apply = Callable[[], None]

MAX_NAMES = 1000
"""Maximum number of names in a request, unless the server has more parameters: each takes time on the physics thread.
"""

_NOT_SET = ParameterValue()
_FIELDS: Final[dict[type[Any], tuple[int, str]]] = {
    bool: (ParameterType.PARAMETER_BOOL, "bool_value"),
    int: (ParameterType.PARAMETER_INTEGER, "integer_value"),
    float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
    str: (ParameterType.PARAMETER_STRING, "string_value"),
}
_SCALARS: Final = dict(_FIELDS.values())


@dataclass(frozen=True, slots=True)
class ServerParameter:
    """One parameter.

    Attributes:
        read: Returns the current value.
        plan: Checks a new value and returns a function that sets it. Raises `RequestError` if the value is refused.
        description: Description with the unit.
        changeable: Whether `plan` accepts a value other than the current one.
    """

    read: Callable[[], Scalar]
    plan: Callable[[Scalar | None], Apply]
    description: str
    changeable: bool = False


def offer(host: Host, loop: Loop, settings: Settings, changeable: ChangeableParameters) -> None:
    """Declares the services. `sim.speed` and the parameters in `changeable` can be set; the others are read-only."""
    services = ParameterServices(parameters(loop, settings), changeable)
    for name, (kind, handler) in services.handlers.items():
        host.create_service(kind, f"~/{name}", _service(handler))


def parameters(loop: Loop, settings: Settings) -> dict[str, ServerParameter]:
    """Returns the parameters of a server by name."""
    described = type(settings.sim).model_fields
    found = {
        "use_sim_time": fixed(True, "Always true: the server publishes the simulated time."),
        "model": fixed(settings.model, "The model, as written in the configuration."),
    }
    for name, value in settings.sim.model_dump(exclude={"speed", "paused", "initial_positions"}).items():
        # A ROS parameter cannot hold a mapping.
        if isinstance(value, Scalar):
            found[f"sim.{name}"] = fixed(value, described[name].description or "")
    for joint, position in settings.sim.initial_positions.items():
        found[f"sim.initial_positions.{joint}"] = fixed(position, described["initial_positions"].description or "")
    found["sim.paused"] = ServerParameter(
        lambda: loop.paused,
        lambda value: _unchanged(value, loop.paused, "use the service ~/set_pause"),
        "Whether the simulation is paused.",
    )

    def plan_speed(value: Scalar | None) -> Apply:
        speed = _speed(value)
        return lambda: loop.set_speed(speed)

    found["sim.speed"] = ServerParameter(
        lambda: loop.pacer.speed, plan_speed, described["speed"].description or "", True
    )
    return found


def fixed(value: Scalar, description: str = "") -> ServerParameter:
    """Returns a read-only parameter."""
    return ServerParameter(
        lambda: value, lambda new: _unchanged(new, value, "set it in the configuration and restart"), description
    )


class ParameterServices:
    """The handlers of the six parameter services.

    Args:
        parameters: The parameters of the server by name.
        changeable: The parameters of plugins; plugins may add more later.
    """

    def __init__(self, parameters: Mapping[str, ServerParameter], changeable: ChangeableParameters) -> None:
        self._own = parameters
        self._changeable = changeable
        self._parameters: dict[str, ServerParameter] = {}
        self._names = Names(())
        self._groups = -1
        self._refresh()

    @property
    def handlers(self) -> Mapping[str, tuple[type[Service], Callable[[Any], Message]]]:
        """Service type and handler by service name; the names are relative to the node's."""
        return {
            "describe_parameters": (DescribeParameters, self._describe),
            "get_parameters": (GetParameters, self._get),
            "get_parameter_types": (GetParameterTypes, self._types),
            "list_parameters": (ListParameters, self._list),
            "set_parameters": (SetParameters, self._set),
            "set_parameters_atomically": (SetParametersAtomically, self._set_atomically),
        }

    def _describe(self, request: DescribeParameters.Request) -> DescribeParameters.Response:
        self._check_count(request.names)
        return DescribeParameters.Response(descriptors=tuple(map(self._descriptor, request.names)))

    def _get(self, request: GetParameters.Request) -> GetParameters.Response:
        self._check_count(request.names)
        return GetParameters.Response(values=tuple(map(self._value, request.names)))

    def _types(self, request: GetParameterTypes.Request) -> GetParameterTypes.Response:
        self._check_count(request.names)
        return GetParameterTypes.Response(types=bytes(self._value(name).type for name in request.names))

    def _list(self, request: ListParameters.Request) -> ListParameters.Response:
        self._refresh()
        searched = frozenset(request.prefixes)
        names = tuple(name for name in self._parameters if _is_below(name, searched, request.depth))
        prefixes = dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)
        return ListParameters.Response(result=ListParametersResult(names=names, prefixes=tuple(prefixes)))

    def _set(self, request: SetParameters.Request) -> SetParameters.Response:
        self._check_count(request.parameters)
        results = []
        for parameter in request.parameters:
            try:
                self._apply([parameter])
            except RequestError as error:
                results.append(SetParametersResult(successful=False, reason=str(error)))
            else:
                results.append(SetParametersResult(successful=True))
        return SetParameters.Response(results=tuple(results))

    def _set_atomically(self, request: SetParametersAtomically.Request) -> SetParametersAtomically.Response:
        self._check_count(request.parameters)
        try:
            self._apply(request.parameters)
        except RequestError as error:
            result = SetParametersResult(successful=False, reason=str(error))
        else:
            result = SetParametersResult(successful=True)
        return SetParametersAtomically.Response(result=result)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        """Sets all of the parameters, or none of them."""
        plans: list[Apply] = []
        changes: dict[str, dict[str, Scalar | None]] = {}
        for parameter in parameters:
            name, value = parameter.name, _scalar(parameter.value)
            group, _, field = name.rpartition(".")
            if self._find(name) is None:
                raise UnknownName("parameter", name, self._names)
            if name not in self._own:
                if value is None:
                    raise RequestError(f"parameter {name}: the value must be a number, text, true or false")
                # Together, because one limit may only be right with another one of the same request.
                changes.setdefault(group, {})[field] = value
                continue
            try:
                plans.append(self._own[name].plan(value))
            except RequestError as error:
                raise RequestError(f"parameter {name!r}: {error}") from None
        self._changeable.change(changes)
        for apply in plans:
            apply()

    def _check_count(self, names: Sequence[object]) -> None:
        self._refresh()
        limit = max(MAX_NAMES, len(self._parameters))
        if len(names) > limit:
            raise RequestError(f"the request contains {len(names)} parameters; at most {limit} are accepted")

    def _refresh(self) -> None:
        """Lists the parameters anew, if plugins have added some."""
        if self._groups != len(self._changeable.groups):
            self._groups = len(self._changeable.groups)
            found = {
                f"{prefix}.{field}": _changeable(group, field, description)
                for prefix, group in self._changeable.groups.items()
                for field, description in group.fields.items()
            }
            self._parameters = dict(sorted({**found, **self._own}.items()))
            self._names = Names(self._parameters)

    def _find(self, name: str) -> ServerParameter | None:
        self._refresh()
        return self._parameters.get(name)

    def _value(self, name: str) -> ParameterValue:
        found = self._find(name)
        return _NOT_SET if found is None else parameter_value(found.read())

    def _descriptor(self, name: str) -> ParameterDescriptor:
        found = self._find(name)
        if found is None:
            return ParameterDescriptor(name=name)
        return ParameterDescriptor(
            name=name,
            type=self._value(name).type,
            description=found.description,
            read_only=not found.changeable,
            # `sim.speed` is a number or the string `max`.
            dynamic_typing=name == "sim.speed",
        )


def _changeable(group: ParameterGroup[Any], field: str, description: str) -> ServerParameter:
    # Set as a whole group, never through `plan`.
    return ServerParameter(partial(group.read, field), _never, description, True)


def _never(value: Scalar | None) -> Apply:
    raise AssertionError("a parameter of a plugin is set through its group")


def parameter_value(value: Scalar) -> ParameterValue:
    """Returns a Python value as a ROS message."""
    kind, field = _FIELDS[type(value)]
    return ParameterValue(**{"type": kind, field: value})


def _scalar(value: ParameterValue) -> Scalar | None:
    """Returns the Python value of a ROS message; None for arrays and for PARAMETER_NOT_SET, which are not supported."""
    field = _SCALARS.get(value.type)
    scalar: Scalar | None = None if field is None else getattr(value, field)
    return scalar


def _unchanged(new: Scalar | None, value: Scalar, remedy: str) -> Apply:
    """Accepts only the current value: launch files set `use_sim_time` on every node, which must not fail."""
    if type(new) is not type(value) or new != value:
        raise RequestError(f"it is read-only; {remedy}")
    return lambda: None


def _speed(value: Scalar | None) -> Speed:
    if value == "max":
        return "max"
    if isinstance(value, int | float) and not isinstance(value, bool) and MIN_SPEED <= value <= MAX_SPEED:
        return float(value)
    shown = quoted(value) if isinstance(value, str) else repr(value)
    raise RequestError(f"it must be a number from {MIN_SPEED:g} to {MAX_SPEED:g}, or 'max', not {shown}")


def _service(handler: Callable[[Any], Message]) -> Callable[[Any, Call], Message]:
    return lambda request, call: handler(request)


def _is_below(name: str, prefixes: Set[str], depth: int) -> bool:
    """Returns whether a name starts with one of the prefixes and is at most `depth` levels below it.

    Depth 0 means no limit. Without prefixes, every name of at most `depth` levels matches.
    """
    if not prefixes:
        return depth == 0 or name.count(".") < depth
    parts = name.split(".")
    return name in prefixes or any(
        ".".join(parts[:level]) in prefixes
        for level in range(1, len(parts))
        if depth == 0 or len(parts) - level <= depth
    )
