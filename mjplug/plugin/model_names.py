"""The names of a model's objects: what stands for a missing one, and how names become parts of ROS names."""

import re
from collections.abc import Iterable, Iterator
from itertools import chain, count
from logging import Logger

import mujoco

_INVALID = re.compile(r"[^A-Za-z0-9_]")


def object_names(model: mujoco.MjModel, kind: mujoco.mjtObj, word: str, number: int) -> list[str]:
    """Returns the names of all objects of a kind, by id.

    An object without a name is called `<word>_<id>`. If another object has that name, it is `<word>_<id>_2`, or with
    the next number that is free.

    Args:
        model: The compiled model.
        kind: The kind of object.
        word: What an object of this kind is called, such as `camera`.
        number: How many objects of this kind the model has.
    """
    names = [mujoco.mj_id2name(model, kind, index) or "" for index in range(number)]
    taken = set(names)
    for index, name in enumerate(names):
        if not name:
            names[index] = _free(f"{word}_{index}", taken)
            taken.add(names[index])
    return names


def ros_tokens(names: Iterable[str], kind: str, logger: Logger) -> dict[str, str]:
    """Returns what stands for each name of the model in names of topics and services.

    A name that ROS allows stays as it is. In another, each character that ROS does not allow becomes `_` (a `/` too),
    and `_` is put before a digit at the start. If the result is taken, `_2` or the next number that is free is added,
    in the order of the names. The log names those that changed.

    Args:
        names: Names in the order of the model.
        kind: What they are names of, such as `camera`.
        logger: Where changed names are logged.
    """
    names = list(dict.fromkeys(names))
    tokens = {name: name for name in names if _token(name) == name}
    taken = set(tokens)
    changed = []
    for name in names:
        if name not in tokens:
            tokens[name] = _free(_token(name), taken)
            taken.add(tokens[name])
            changed.append(f"{name!r} is {tokens[name]}")
    if changed:
        logger.info("the names of topics and services spell a %s as ROS allows: %s", kind, ", ".join(changed))
    return {name: tokens[name] for name in names}


def _token(name: str) -> str:
    plain = _INVALID.sub("_", name)
    return f"_{plain}" if plain[:1].isdigit() else plain or "_"


def _free(name: str, taken: set[str]) -> str:
    candidates: Iterator[str] = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)
