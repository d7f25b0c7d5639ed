"""Checks that the text of a model is UTF-8: MuJoCo accepts any bytes, but Python and ROS need UTF-8."""

from pathlib import Path

import mujoco

from mjplug.errors import ModelError

_KINDS = (
    "body", "jnt", "geom", "site", "cam", "light", "flex", "mesh", "skin", "hfield", "tex", "mat", "pair", "exclude",
    "eq", "tendon", "actuator", "sensor", "numeric", "text", "tuple", "key", "plugin",
)  # fmt: skip
"""MuJoCo's abbreviations of the kinds of named objects, as in `name_bodyadr`."""

_WORDS = {"jnt": "joint", "cam": "camera", "tex": "texture", "mat": "material", "eq": "equality", "key": "keyframe"}
"""MJCF's words for the kinds with another abbreviation."""

_REMEDY = "save the model's files in UTF-8"


def check_names(model: mujoco.MjModel, path: Path) -> None:
    """Checks that all names of a model are UTF-8.

    Otherwise, MuJoCo's Python functions would fail later when they return such a name.

    Args:
        model: The compiled model.
        path: The model's file, for the error message.

    Raises:
        ModelError: A name is not UTF-8. The message contains the element, and the line if it is in this file.
    """
    names = bytes(model.names)
    try:
        names.decode()
    except UnicodeDecodeError as error:
        start = names.rfind(b"\0", 0, error.start) + 1
        name = names[start : names.index(b"\0", start)]
        place = f"{path}{_line(path, name)}"
        shown = name.decode(errors="backslashreplace")
        raise ModelError(f"{place}: the name of {_owner(model, start)} is not UTF-8: '{shown}'; {_REMEDY}") from None


def message_of(error: Exception) -> str:
    """Returns the message of a MuJoCo error, also if it quotes text that is not UTF-8."""
    if isinstance(error, UnicodeDecodeError):
        return f"{error.object.decode(errors='backslashreplace')}\n{_REMEDY}"
    return str(error)


def _owner(model: mujoco.MjModel, address: int) -> str:
    """Returns the element whose name is at an address in the buffer of names."""
    for kind in _KINDS:
        addresses = getattr(model, f"name_{kind}adr").tolist()
        if address in addresses:
            return f"{_WORDS.get(kind, kind)} {addresses.index(address)}"
    return "the model"


def _line(path: Path, name: bytes) -> str:
    """Returns `:<line>` of the first place in a file with the name in quotes; empty if there is none."""
    content = path.read_bytes()
    places = [content.find(quote + name + quote) for quote in (b'"', b"'")]
    found = min((place for place in places if place >= 0), default=-1)
    line = content.count(b"\n", 0, found) + 1
    return f":{line}" if found >= 0 else ""
