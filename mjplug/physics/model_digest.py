"""Identifies a model, so that a state is restored only with the model that it was saved with."""

import hashlib
from collections.abc import Iterator

import mujoco
import numpy as np
from xxhash import xxh3_128_digest

_NOT_PHYSICS = frozenset({"nbuffer", "signature"})
"""Numbers that depend on file names."""


def model_digest(model: mujoco.MjModel) -> str:
    """Returns a digest of all values of a model and of the version of MuJoCo, hexadecimal.

    File names are left out, so that it does not depend on the folder of the model. It takes a few milliseconds even for
    a model with large meshes, because arrays are hashed with XXH3.
    """
    total = hashlib.sha256(mujoco.__version__.encode())
    for name, value in _values("", model):
        total.update(f"\n{name} ".encode())
        total.update(value)
    return total.hexdigest()


def _values(prefix: str, owner: object) -> Iterator[tuple[str, bytes]]:
    """Yields the numbers and arrays of a model or of its options, in the order of their names."""
    for name in dir(owner):
        if name.startswith("_") or "path" in name or name in _NOT_PHYSICS:
            continue
        value = getattr(owner, name)
        if isinstance(value, np.ndarray):
            array = np.ascontiguousarray(value)
            digest = xxh3_128_digest(array.data.cast("B")) if array.size else b""
            yield f"{prefix}{name} {array.dtype.str} {array.shape}", digest
        elif isinstance(value, bool | int | float):
            yield f"{prefix}{name}", repr(value).encode()
        elif isinstance(value, bytes):
            yield f"{prefix}{name}", xxh3_128_digest(value)
        elif name in ("opt", "stat") and not prefix:
            yield from _values(f"{name}.", value)
