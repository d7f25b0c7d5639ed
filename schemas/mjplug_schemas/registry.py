"""Finds messages and services by their ROS type names."""

import inspect
from functools import cache
from types import MappingProxyType

from mjplug_schemas import (
    builtin_interfaces,
    control_msgs,
    diagnostic_msgs,
    geometry_msgs,
    mjplug_msgs,
    mujoco_ros2_control_msgs,
    nav_msgs,
    rcl_interfaces,
    rosgraph_msgs,
    sensor_msgs,
    service_msgs,
    std_msgs,
    std_srvs,
    tf2_msgs,
    trajectory_msgs,
    type_description_interfaces,
    visualization_msgs,
)
from mjplug_schemas.errors import DefinitionError, UnknownType
from mjplug_schemas.message import Message, Service

_PACKAGES = (
    builtin_interfaces,
    control_msgs,
    diagnostic_msgs,
    geometry_msgs,
    mjplug_msgs,
    mujoco_ros2_control_msgs,
    nav_msgs,
    rcl_interfaces,
    rosgraph_msgs,
    sensor_msgs,
    service_msgs,
    std_msgs,
    std_srvs,
    tf2_msgs,
    trajectory_msgs,
    type_description_interfaces,
    visualization_msgs,
)

_added: dict[str, type[Message] | type[Service]] = {}


def find(name: str) -> type[Message] | type[Service]:
    """Returns the class of a ROS type, such as `std_msgs/msg/String`, `std_srvs/srv/Trigger` or `…/Trigger_Request`.

    Raises:
        UnknownType: The type is not defined; the text suggests a similar name.
    """
    types = all_types()
    if name in types:
        return types[name]
    service_name, _, part = name.rpartition("_")
    service = types.get(service_name)
    if part in ("Request", "Response") and isinstance(service, type) and issubclass(service, Service):
        return service.Request if part == "Request" else service.Response
    raise UnknownType(name, types)


def all_types() -> MappingProxyType[str, type[Message] | type[Service]]:
    """Returns all messages and services by their ROS type names, in alphabetical order."""
    return MappingProxyType(dict(sorted((_bundled() | _added).items())))


def add(interface: type[Message] | type[Service]) -> None:
    """Adds a type from outside this package to the registry.

    Raises:
        DefinitionError: Another class already has the same type name.
    """
    if all_types().get(interface.TYPE, interface) is not interface:
        raise DefinitionError(f"{interface.TYPE} is already defined by {find(interface.TYPE).__module__}")
    _added[interface.TYPE] = interface


@cache
def _bundled() -> dict[str, type[Message] | type[Service]]:
    types: dict[str, type[Message] | type[Service]] = {}
    for package in _PACKAGES:
        for _, interface in inspect.getmembers(package, inspect.isclass):
            if issubclass(interface, Message | Service) and interface.__module__ == package.__name__:
                types[interface.TYPE] = interface
    return types
