"""Names of the objects of a model, and their conversion to parts of ROS names."""

import re
from collections.abc import Iterable, Iterator
from itertools import chain, count
from logging import Logger

import mujoco

_INVALID = re.compile(r"[^A-Za-z0-9_]")


def object_names(model: mujoco.MjModel, kind: mujoco.mjtObj, word: str, number: int) -> list[str]:
    """Returns the names of all objects of a kind, ordered by id.

    An unnamed object is called `<word>_<id>`. If another object has that name, `_2` or the next free number is
    appended.

    Args:
        model: The compiled model.
        kind: The kind of object.
        word: The word for an object of this kind, such as `camera`.
        number: Number of objects of this kind in the model.
    """
    names = [mujoco.mj_id2name(model, kind, index) or "" for index in range(number)]
    taken = set(names)
    for index, name in enumerate(names):
        if not name:
            names[index] = _free(f"{word}_{index}", taken)
            taken.add(names[index])
    return names


def ros_tokens(names: Iterable[str], kind: str, logger: Logger) -> dict[str, str]:
    """Converts names of the model to tokens for names of topics and services.

    A name that ROS allows is not changed. In any other name, each character that ROS does not allow becomes `_` (also
    `/`), and `_` is put before a leading digit. If the result is already used, `_2` or the next free number is
    appended, in the order of the names. Changed names are logged.

    Args:
        names: Names in the order of the model.
        kind: The kind of object, such as `camera`.
        logger: Logs changed names.

    Returns:
        The token of each name.
    """
    names = list(dict.fromkeys(names))
    tokens = {name: name for name in names if _token(name) == name}
    taken = set(tokens)
    changed = []
    for name in names:
        if name not in tokens:
            tokens[name] = _free(_token(name), taken)
            taken.add(tokens[name])
            changed.append(f"{name!r} -> {tokens[name]}")
    if changed:
        logger.info("%s names changed to valid ROS names in topics and services: %s", kind, ", ".join(changed))
    return {name: tokens[name] for name in names}


def _token(name: str) -> str:
    plain = _INVALID.sub("_", name)
    return f"_{plain}" if plain[:1].isdigit() else plain or "_"


def _free(name: str, taken: set[str]) -> str:
    candidates: Iterator[str] = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)
