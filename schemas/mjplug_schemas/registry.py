"""Finds messages, services and actions by their ROS type names."""

import inspect
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType

from mjplug_schemas.action import Action
from mjplug_schemas.errors import DefinitionError, UnknownType
from mjplug_schemas.message import Message, Service

_PACKAGES = (
    "action_msgs",
    "builtin_interfaces",
    "control_msgs",
    "diagnostic_msgs",
    "geometry_msgs",
    "mjplug_msgs",
    "mujoco_ros2_control_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "service_msgs",
    "simulation_interfaces",
    "std_msgs",
    "std_srvs",
    "tf2_msgs",
    "trajectory_msgs",
    "type_description_interfaces",
    "unique_identifier_msgs",
    "visualization_msgs",
)

_MORE_MODULES = {"control_msgs": ("control_msgs_action",)}
"""Modules with further types of a package; the others have one module, with the name of the package."""

Interface = type[Message] | type[Service] | type[Action]

_added: dict[str, Interface] = {}


def find(name: str) -> Interface:
    """Returns the class of a ROS type, such as `std_msgs/msg/String`, `std_srvs/srv/Trigger` or `…/Trigger_Request`.

    Types that are derived from an action, such as `…/Fibonacci_SendGoal`, are found too.

    Raises:
        UnknownType: The type is not defined; the text suggests a similar name.
    """
    # Importing a package of many types takes tenths of a second, so the others are imported only if necessary.
    types: Mapping[str, Interface] = _types_of(name.partition("/")[0]) | _added
    if name in types:
        return types[name]
    service_name, _, part = name.rpartition("_")
    service = types.get(service_name)
    if part in ("Request", "Response") and isinstance(service, type) and issubclass(service, Service):
        return service.Request if part == "Request" else service.Response
    # The names of derived types of actions contain up to two parts after the name of the action.
    for action_name in (service_name, service_name.rpartition("_")[0]):
        action = types.get(action_name)
        if isinstance(action, type) and issubclass(action, Action) and name in action.derived():
            return action.derived()[name]
    raise UnknownType(name, all_types())


def all_types() -> MappingProxyType[str, Interface]:
    """Returns all messages, services and actions by their ROS type names, in alphabetical order."""
    return MappingProxyType(dict(sorted((_bundled() | _added).items())))


def add(interface: Interface) -> None:
    """Adds a type from outside this package to the registry.

    Raises:
        DefinitionError: Another class already has the same type name.
    """
    if all_types().get(interface.TYPE, interface) is not interface:
        raise DefinitionError(f"{interface.TYPE} is already defined by {find(interface.TYPE).__module__}")
    _added[interface.TYPE] = interface


def _bundled() -> dict[str, Interface]:
    types: dict[str, Interface] = {}
    for package in _PACKAGES:
        types |= _types_of(package)
    return types


@cache
def _types_of(package: str) -> dict[str, Interface]:
    """Returns the types of a package by their names; empty if it is not in this distribution."""
    if package not in _PACKAGES:
        return {}
    types: dict[str, Interface] = {}
    for name in (package, *_MORE_MODULES.get(package, ())):
        module = import_module(f"mjplug_schemas.{name}")
        for _, interface in inspect.getmembers(module, inspect.isclass):
            if issubclass(interface, Message | Service | Action) and interface.__module__ == module.__name__:
                types[interface.TYPE] = interface
    return types
