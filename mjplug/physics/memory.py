"""Memoryviews of MuJoCo's arrays. For a few numbers at every step, they take a third of numpy's time."""

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MAX_GAP = 256
"""Maximum gap between two arrays that are copied in one piece [bytes]. MuJoCo aligns its arrays, which leaves small
gaps between them; copying a gap costs less than a second copy."""


def float_view(array: NDArray[np.float64]) -> "memoryview[float]":
    """Returns a flat, writable view of shape (array.size,) of a contiguous array."""
    return array.data.cast("B").cast("d")


class ZeroedArrays:
    """Arrays that are set to zero repeatedly.

    Args:
        arrays: Contiguous arrays of any shape. They must not be reallocated.
    """

    def __init__(self, arrays: Iterable[NDArray[np.float64]]) -> None:
        views = [array.data.cast("B") for array in arrays if array.size]
        # A memoryview, because assigning bytes takes twice as long.
        self._pairs = [(view, memoryview(bytes(len(view)))) for view in views]

    def clear(self) -> None:
        """Sets every element to zero."""
        for view, zeros in self._pairs:
            view[:] = zeros


class SavedArrays:
    """A copy of some arrays that can be restored.

    Arrays that are next to each other in memory, such as those of mjData's state, are copied in one piece. Restoring
    writes the arrays only, not the gaps between them.

    Args:
        arrays: Contiguous arrays of any shape. They must not be reallocated.
    """

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        self._arrays = sorted((array for array in arrays if array.size), key=lambda array: array.ctypes.data)
        self._saves: list[tuple[memoryview[int], memoryview[int]]] = []
        self._restores: list[tuple[memoryview[int], memoryview[int]]] = []
        for run in _runs(self._arrays):
            begin, end = run[0].ctypes.data, run[-1].ctypes.data + run[-1].nbytes
            original = memoryview((ctypes.c_ubyte * (end - begin)).from_address(begin)).cast("B")
            copy = memoryview(bytearray(original))
            self._saves.append((original, copy))
            for array in run:
                at = array.ctypes.data - begin
                self._restores.append((array.data.cast("B"), copy[at : at + array.nbytes]))

    def save(self) -> None:
        """Copies the current values of the arrays."""
        for original, copy in self._saves:
            copy[:] = original

    def restore(self) -> None:
        """Writes the copied values to the arrays."""
        for view, copy in self._restores:
            view[:] = copy


def _runs(arrays: Iterable[NDArray[Any]]) -> list[list[NDArray[Any]]]:
    """Groups arrays that are neighbours in memory; `arrays` must be sorted by address."""
    runs: list[list[NDArray[Any]]] = []
    for array in arrays:
        near = runs and array.ctypes.data - (runs[-1][-1].ctypes.data + runs[-1][-1].nbytes) <= _MAX_GAP
        if near:
            runs[-1].append(array)
        else:
            runs.append([array])
    return runs
