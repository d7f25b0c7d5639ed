"""The controls of a step request, row by row."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError

MAX_ACTIONS = 1 << 17
"""Maximum number of actions in a request."""

_FEW = 16
_LIMIT = float(mujoco.mjMAXVAL)


def control_rows(ctrl: "Sequence[float] | memoryview[float]", nu: int, rows: str = "k") -> NDArray[np.float64]:
    """Returns the controls of a request, shape (k, nu); k is 0 if there are none.

    Args:
        ctrl: k * nu numbers.
        nu: Number of actuators.
        rows: How the number of rows is called in error messages.

    Raises:
        RequestError: The number of values is not a multiple of nu, or a value is not finite or too large.
    """
    count = len(ctrl)
    if count == nu <= _FEW and count and all(-_LIMIT < value < _LIMIT for value in ctrl):
        # One action of a few numbers, the most frequent request, is checked faster without numpy.
        return np.array(ctrl, np.float64).reshape(1, nu)
    values = np.asarray(ctrl, np.float64)
    if not count:
        return np.empty((0, nu))
    if nu == 0:
        raise RequestError(f"ctrl has {values.size} values, but the model has no actuator; leave ctrl empty")
    if values.size % nu:
        raise RequestError(
            f"ctrl has {values.size} values; it must have {rows} * {nu}, because the model has {nu} actuators"
        )
    # NaN fails the comparison too.
    valid = np.abs(values) < _LIMIT
    if not valid.all():
        first = int(np.argmin(valid))
        raise RequestError(
            f"ctrl[{first}] is {values[first]:g} (row {first // nu}, actuator {first % nu}); it must be finite and its "
            f"absolute value below {mujoco.mjMAXVAL:g}"
        )
    return values.reshape(-1, nu)
