"""Plain bytes of MuJoCo's arrays: for a few numbers at every step, memoryviews cost a third of what numpy does."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def doubles(array: NDArray[np.float64]) -> "memoryview[float]":
    """Returns a flat, writable view of the floats of a contiguous array."""
    return array.data.cast("B").cast("d")


class Cleared:
    """Arrays that are set to zero again and again."""

    def __init__(self, arrays: Iterable[NDArray[np.float64]]) -> None:
        views = [array.data.cast("B") for array in arrays if array.size]
        # From view to view: assigning bytes takes twice as long.
        self._pairs = [(view, memoryview(bytes(len(view)))) for view in views]

    def clear(self) -> None:
        """Sets every element to zero."""
        for view, zeros in self._pairs:
            view[:] = zeros


class Saved:
    """A copy of some arrays that can be put back."""

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        views = [array.data.cast("B") for array in arrays if array.size]
        self._pairs = [(view, memoryview(bytearray(view))) for view in views]

    def save(self) -> None:
        """Copies the arrays as they are now."""
        for view, copy in self._pairs:
            copy[:] = view

    def restore(self) -> None:
        """Puts the copy back."""
        for view, copy in self._pairs:
            view[:] = copy
