"""The controls of a step request, row by row."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.memory import float_view

MAX_ACTIONS = 1 << 17
"""Maximum number of actions in a request."""

_FEW = 16
_LIMIT = float(mujoco.mjMAXVAL)


def checked_controls(ctrl: "Sequence[float] | memoryview[float]", nu: int, rows: str = "k") -> "memoryview[float]":
    """Returns the controls of a request, one row of nu numbers after the other, if they are valid.

    Args:
        ctrl: k * nu numbers, or none. A read-only memoryview is not copied.
        nu: Number of actuators.
        rows: How the number of rows is called in error messages.

    Raises:
        RequestError: The number of values is not a multiple of nu, or a value is not finite or too large.
    """
    if not isinstance(ctrl, memoryview) or not ctrl.readonly:
        ctrl = float_view(np.array(ctrl, np.float64))
    count = len(ctrl)
    if not count:
        return ctrl
    if nu == 0:
        raise RequestError(f"ctrl has {count} values, but the model has no actuator; leave ctrl empty")
    if count % nu:
        raise RequestError(f"ctrl has {count} values; it must have {rows} * {nu}, because the model has {nu} actuators")
    first = _first_invalid(ctrl)
    if first is not None:
        raise RequestError(
            f"ctrl[{first}] is {ctrl[first]:g} (row {first // nu}, actuator {first % nu}); it must be finite and its "
            f"absolute value below {mujoco.mjMAXVAL:g}"
        )
    return ctrl


def _first_invalid(values: "memoryview[float]") -> int | None:
    # NaN fails the comparisons too.
    if len(values) <= _FEW:
        # The controls of one action, the most frequent request, are checked faster without numpy.
        for i, value in enumerate(values):
            if not -_LIMIT < value < _LIMIT:
                return i
        return None
    valid = np.abs(np.asarray(values)) < _LIMIT
    return None if valid.all() else int(np.argmin(valid))
