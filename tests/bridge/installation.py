"""A folder with message packages as a ROS installation has them: definitions, and from Iron on their hashes."""

import json

from mjplug_schemas.definition import definition
from mjplug_schemas.registry import all_types
from mjplug_schemas.rihs01 import type_hash


def install(prefix, without=(), hashes=True):
    """Writes all packages but some.

    Args:
        prefix: Where to; goes into AMENT_PREFIX_PATH.
        without: Packages to leave out.
        hashes: Whether to write hashes.
    """
    for interface in all_types().values():
        package, kind, name = interface.TYPE.split("/")
        if package in without:
            continue
        folder = prefix / "share" / package / kind
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.{kind}").write_text(definition(interface), encoding="utf-8")
        if hashes:
            write_hash(prefix, interface.TYPE, type_hash(interface))
            if kind == "action":
                write_hashes(prefix, interface)


def write_hash(prefix, type_name, hash):
    """Writes the hash of a type into its file, as rosidl_generator_type_description does."""
    told = {"type_hashes": [{"type_name": type_name, "hash_string": hash}]}
    (prefix / "share" / f"{type_name}.json").write_text(json.dumps(told), encoding="utf-8")


def write_hashes(prefix, action):
    """Writes the hashes of an action and its derived types into its file."""
    types = {action.TYPE: action} | action.derived()
    told = {"type_hashes": [{"type_name": name, "hash_string": type_hash(part)} for name, part in types.items()]}
    (prefix / "share" / f"{action.TYPE}.json").write_text(json.dumps(told), encoding="utf-8")
