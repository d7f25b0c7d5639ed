"""ROS 2 names: validation, resolution of relative names, and conversion to Zenoh keys."""

import re
from collections.abc import Mapping
from types import MappingProxyType

from mjplug_schemas.errors import NameRuleError

MAX_NAME_LENGTH = 247
"""Largest length of a full name [characters]: rmw's limit, which allows for the prefixes of DDS."""

NAMESPACE = "{ns}"
"""ROS 2's substitution for the namespace: `{ns}/scan` is `/robot1/scan` in the namespace `/robot1`, else `/scan`."""

_NO_REMAP: Mapping[str, str] = MappingProxyType({})


def validate_name(name: str) -> None:
    """Checks a full topic or service name, such as `/robot1/cmd_vel`.

    Raises:
        NameRuleError: The name breaks a rule of ROS; the text contains the rule.
    """
    if not name.startswith("/"):
        raise _broken("name", name, "a full name must start with '/'")
    if name == "/" or name.endswith("/"):
        raise _broken("name", name, "a name must not end with '/'")
    _check_tokens("name", name, name[1:])
    if len(name) > MAX_NAME_LENGTH:
        raise _broken("name", name, f"it has {len(name)} characters; at most {MAX_NAME_LENGTH} are allowed")


def validate_node_name(name: str) -> None:
    """Checks the name of a node or of a plugin instance, such as `mjplug`.

    Raises:
        NameRuleError: The name breaks a rule of ROS.
    """
    if not name:
        raise _broken("node name", name, "it must not be empty")
    if "/" in name:
        raise _broken("node name", name, "it must not contain '/'; set the namespace separately")
    _check_tokens("node name", name, name)
    if len(name) > MAX_NAME_LENGTH:
        raise _broken("node name", name, f"it has {len(name)} characters; at most {MAX_NAME_LENGTH} are allowed")


def normalize_namespace(namespace: str) -> str:
    """Returns a namespace with its leading `/`: `robot1` is `/robot1`; the root (`""` or `/`) is the empty string.

    Raises:
        NameRuleError: The name breaks a rule of ROS.
    """
    if namespace in ("", "/"):
        return ""
    full = namespace if namespace.startswith("/") else f"/{namespace}"
    if full.endswith("/"):
        raise _broken("namespace", namespace, "it must not end with '/'")
    _check_tokens("namespace", namespace, full[1:])
    if len(full) > MAX_NAME_LENGTH - 2:
        raise _broken(
            "namespace", namespace, f"it has {len(full)} characters; at most {MAX_NAME_LENGTH - 2} are allowed"
        )
    return full


def resolve(name: str, *, namespace: str = "", node: str, remap: Mapping[str, str] = _NO_REMAP) -> str:
    """Resolves the name of an interface of a node or plugin instance to its full name.

    Args:
        name: `/absolute`, `{ns}/name`, which means `/<namespace>/name`, or `relative` or `~/relative`, both of which
            mean `/<namespace>/<node>/relative`.
        namespace: The namespace of the server, or of the plugin instance.
        node: The name of the node, or of the plugin instance.
        remap: New names by full names; both may begin with `{ns}/`.

    Raises:
        NameRuleError: The name, the resolved name or the remapped name breaks a rule of ROS.
    """
    if not name:
        raise _broken("name", name, "it must not be empty")
    if name.startswith(("/", NAMESPACE)):
        full = in_namespace(name, namespace)
    else:
        if "{" in name:
            raise _broken("name", name, f"the only substitution is {NAMESPACE!r}, at the start and followed by '/'")
        if name == "~" or (name.startswith("~") and name[1] != "/"):
            raise _broken("name", name, "'~' is allowed only at the start, followed by '/' and a name")
        relative = name.removeprefix("~/")
        if relative.startswith("/"):
            raise _broken("name", name, "a name must not contain '//'")
        if not relative:
            raise _broken("name", name, "a name must not end with '/'")
        validate_node_name(node)
        full = f"{normalize_namespace(namespace)}/{node}/{relative}"
    validate_name(full)
    for old, new in remap.items():
        if in_namespace(old, namespace) == full:
            full = in_namespace(new, namespace)
            validate_name(full)
            break
    return full


def in_namespace(name: str, namespace: str) -> str:
    """Returns a name with a leading `{ns}` replaced by the namespace, such as `/robot1` or the empty string.

    Raises:
        NameRuleError: The namespace breaks a rule of ROS.
    """
    if not name.startswith(f"{NAMESPACE}/"):
        return name
    return normalize_namespace(namespace) + name.removeprefix(NAMESPACE)


def validate_substituted(name: str) -> None:
    """Checks a full name that may begin with `{ns}/`, such as `/robot1/scan` or `{ns}/scan`.

    Raises:
        NameRuleError: The name breaks a rule of ROS; the text contains the rule.
    """
    validate_name(in_namespace(name, ""))


def key(name: str) -> str:
    """Returns the Zenoh key of a full name: the name without the leading `/`."""
    return name.removeprefix("/")


def dds_type(type_name: str) -> str:
    """Returns a ROS type name in the form of DDS: `std_msgs/msg/String` is `std_msgs::msg::dds_::String_`."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _check_tokens(kind: str, name: str, tokens: str) -> None:
    if bad := re.search(r"[^A-Za-z0-9_/]", tokens):
        allowed = "digits and '_'" if kind == "node name" else "digits, '_' and '/'"
        raise _broken(kind, name, f"{bad[0]!r} is not allowed; use letters of the English alphabet, {allowed}")
    for token in tokens.split("/"):
        if not token:
            raise _broken(kind, name, "a name must not contain '//'")
        if token[0].isdigit():
            raise _broken(kind, name, f"{token!r} must not start with a digit")


def _broken(kind: str, name: str, rule: str) -> NameRuleError:
    shown = name if len(name) <= 80 else f"{name[:77]}…"
    return NameRuleError(f"{shown!r} is not a valid ROS {kind}: {rule}")
