"""Resolves the names of a plugin instance: namespace, TF frame prefix, and default names."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from mjplug.config.settings import PluginEntry, Settings
from mjplug_schemas.names import NAMESPACE, normalize_namespace, resolve

REFERENCE_TYPES = "mujoco_ros2_control_plugins/"
"""Prefix of the plugin types of mujoco_ros2_control."""


@dataclass(frozen=True, slots=True)
class InstanceNames:
    """The names of the server itself or of one plugin instance.

    Attributes:
        full_name: Returns the full ROS name of a name, after remapping.
        frame_prefix: Prefix of TF frames, such as `robot1/`.
    """

    full_name: Callable[[str], str]
    frame_prefix: str


def server_names(settings: Settings) -> InstanceNames:
    """Returns the names of the server itself."""
    return InstanceNames(_resolver(settings, settings.node_name, settings.namespace), "")


def instance_names(settings: Settings, instance: str) -> InstanceNames:
    """Returns the names of a plugin instance."""
    entry = settings.plugins.get(instance)
    namespace, prefix = settings.namespace, settings.frame_prefix
    if entry is not None:
        if entry.namespace is not None:
            own = normalize_namespace(entry.namespace)
            namespace = own if entry.namespace.startswith("/") else namespace + own
        if entry.frame_prefix is not None:
            prefix = entry.frame_prefix
    full_name = _resolver(settings, instance, namespace)
    return InstanceNames(
        partial(_documented, full_name) if entry is not None and has_documented_names(entry) else full_name,
        prefix.replace(NAMESPACE, namespace.strip("/")).lstrip("/"),
    )


def has_documented_names(entry: PluginEntry) -> bool:
    """Returns whether an instance has the absolute default names that mujoco_ros2_control documents, such as `/scan`.

    If so, `{ns}` in the default names stands for nothing, and no parameter in the entry contains it.
    """
    return entry.type.startswith(REFERENCE_TYPES) and entry.namespace is None and not _substitutes(entry.parameters)


def _resolver(settings: Settings, node: str, namespace: str) -> Callable[[str], str]:
    return partial(resolve, namespace=namespace, node=node, remap=settings.remap)


def _documented(full_name: Callable[[str], str], name: str) -> str:
    """Returns the full name of a default name such as `{ns}/scan`, without the namespace."""
    return full_name(name.removeprefix(NAMESPACE))


def _substitutes(value: object) -> bool:
    """Returns whether the parameters contain `{ns}`; if so, it also applies to default names."""
    if isinstance(value, Mapping):
        return any(map(_substitutes, value.values()))
    if isinstance(value, list | tuple):
        return any(map(_substitutes, value))
    return isinstance(value, str) and NAMESPACE in value
