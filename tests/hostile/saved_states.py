"""Hostile files of saved states: a right one, in which a few values of the header or of arrays are replaced.

Checksums and digests are right, so that the values reach the server and its plugins. A file is refused with a sentence
and nothing changes, or it is restored and the simulation goes on; a divergence is one like any other.
"""

import io
import json
import logging
import math
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from hostile.attack import Tally, arguments, random_of
from state_worlds import StateWorld

from mjplug.physics import physics_state
from mjplug_schemas.mjplug_msgs import RestoreState

VALUES = (
    None, True, False, 0, 1, -1, 2, 151, 10**6, 2**31, 2**53 + 1, 2**62, 2**63 - 1, 2**63, 2**64, -(2**63), 0.0, -0.5,
    1e-320, 1e10, 1e300, math.inf, -math.inf, math.nan, "", "x", "brick", "world", "\0", "é" * 200, [], {}, [[]],
    [0, 1], {"a": 1}, [None] * 50,
)  # fmt: skip
"""What replaces a value of the header."""

NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e10, -1e12, 1e300, math.inf, -math.inf, math.nan, 2.0**31, 2.0**53, 2.0**63)
"""What replaces a number in an array."""

STEPS = 40
"""Steps after each restore: some of every topic, and of every plugin's updates."""


class Content:
    """The file of a saved state, as a header and arrays."""

    def __init__(self, content):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            self.header = json.loads(archive.read("header.json"))
        with np.load(io.BytesIO(content)) as found:
            self.arrays = {name: found[name].copy() for name in found.files if name != "header.json"}

    def changed(self, random):
        """Returns the bytes of a file in which a few values are replaced."""
        header, arrays = json.loads(json.dumps(self.header)), dict(self.arrays)
        for _ in range(random.choice((1, 1, 2, 4))):
            if random.random() < 0.6:
                header = self._with_value(header, random)
            else:
                self._change_array(arrays, random)
        if random.random() < 0.95 and isinstance(header, dict) and arrays.get("vector") is not None:
            header["digest"] = physics_state.digest(np.asarray(arrays["vector"], np.float64))
        return encoded(header, arrays)

    def _with_value(self, header, random):
        """Replaces, removes or adds a value anywhere in the header, also inside the JSON text of a plugin."""
        if random.random() < 0.5:
            parts = header.get("parts") if isinstance(header, dict) else None
            part = random.choice(list(parts.values())) if isinstance(parts, dict) and parts else None
            values = part.get("values") if isinstance(part, dict) else None
            if isinstance(values, dict) and isinstance(values.get("saved"), str) and len(values["saved"]) > 2:
                values["saved"] = json.dumps(_replaced(json.loads(values["saved"]), random))
                return header
        return _replaced(header, random)

    def _change_array(self, arrays, random):
        name = random.choice([name for name in arrays if not name.startswith("results/")] + ["results/xpos"])
        array = np.array(arrays[name], copy=True)
        kind = random.random()
        if kind < 0.1:
            with np.errstate(all="ignore"):
                array = array.astype(random.choice((np.float32, np.int64, np.uint8, np.bool_, np.complex128)))
        elif kind < 0.2:
            array = random.choice((array.reshape(-1)[:-1], np.append(array.reshape(-1), 0.0), array[None], array[:0]))
        elif array.size:
            for _ in range(random.choice((1, 1, 3))):
                value = random.choice(NUMBERS)
                with np.errstate(all="ignore"):
                    array.reshape(-1)[random.randrange(array.size)] = np.array(value).astype(array.dtype)
        arrays[name] = array


def _replaced(tree, random):
    """Returns a copy of a JSON value with another value somewhere in it."""
    places = list(_places(tree))
    path = random.choice(places)
    if not path:
        return random.choice(VALUES)
    parent = tree
    for key in path[:-1]:
        parent = parent[key]
    kind = random.random()
    if kind < 0.1 and isinstance(parent, dict):
        del parent[path[-1]]
    elif kind < 0.15 and isinstance(parent, dict):
        parent["more"] = random.choice(VALUES)
    elif kind < 0.4 and isinstance(parent[path[-1]], int | float):
        parent[path[-1]] += random.choice((1, -1, 0.5, 1000, -(10**9)))
    else:
        parent[path[-1]] = random.choice(VALUES)
    return tree


def _places(tree, path=()):
    yield path
    if isinstance(tree, dict | list):
        for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
            yield from _places(value, (*path, key))


def encoded(header, arrays):
    """Returns the bytes of a file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("header.json", json.dumps(header))
        for name, array in arrays.items():
            member = io.BytesIO()
            np.save(member, array)
            archive.writestr(f"{name}.npy", member.getvalue())
    return buffer.getvalue()


class Errors(logging.Handler):
    """Keeps the log records with an exception."""

    def __init__(self):
        super().__init__()
        self.found = []

    def emit(self, record):
        if record.exc_info or "internal error" in record.getMessage():
            self.found.append(self.format(record))


def attack(tally, first, count):
    """Restores one hostile file after the other."""
    errors, logger = Errors(), logging.getLogger("mjplug")
    logger.addHandler(errors)
    logger.propagate = False
    with tempfile.TemporaryDirectory() as folder:
        world = StateWorld(Path(folder))
        world.prepare(90)
        world.save("right", file=True)
        content = Content((Path(folder) / "right.npz").read_bytes())
        expected = world.run(60)
        try:
            for index in range(first, first + count):
                file = content.changed(random_of(tally.seed, index))
                (Path(folder) / "x.npz").write_bytes(file)
                _restore(tally, world, index, errors)
                tally.inputs += 1
                if world.loop.failure is not None:
                    tally.find(index, f"the server stops: {world.loop.failure}")
                    world.close()
                    world = StateWorld(Path(folder))
                if (index - first) % 25 == 24 and not _is_right(tally, world, index, expected):
                    break
                if tally.over:
                    break
        finally:
            logger.removeHandler(errors)
            logger.propagate = True
            world.close()


def _restore(tally, world, index, errors):
    before = world.digest(), world.simulation.step, world.simulation.epoch, len(world.wrench._active)
    call = world.request("restore_state", RestoreState, name="x", file=True, strict=bool(index % 2))
    if call.refusal is not None:
        tally.count("refused")
        after = world.digest(), world.simulation.step, world.simulation.epoch, len(world.wrench._active)
        if after != before:
            tally.find(index, f"refused, but {before} is now {after}: {call.refusal}")
        if not 5 < len(call.refusal) < 5000 or "internal error" in call.refusal:
            tally.find(index, f"the answer is {call.refusal[:300]!r}")
    elif call.response.snapshot.left_out:
        tally.count("left out")
    world.clear()
    world.loop.step(STEPS)
    if errors.found:
        tally.find(index, errors.found[0])
        errors.found.clear()


def _is_right(tally, world, index, expected):
    """Restores the right file, and compares what follows with what followed it at first."""
    world.restore("right", file=True)
    if world.run(60) != expected:
        tally.find(index, "after this file, the right one no longer continues as it did")
        return False
    return True


def main(argv=None):
    """Runs the attack; returns the exit code."""
    options = arguments(argv, "Restores hostile files of saved states.", 2_000, 600.0)
    tally = Tally(
        "saved states",
        options.seed,
        options.seconds,
        counts={"refused": 0, "left out": 0},
        module="hostile.saved_states",
    )
    attack(tally, options.first, options.count)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
