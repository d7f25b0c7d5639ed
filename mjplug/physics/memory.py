"""Plain bytes of MuJoCo's arrays: for a few numbers at every step, memoryviews cost a third of what numpy does."""

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_GAP = 256
"""MuJoCo aligns its arrays, so that neighbours lie a little apart; to copy that too is cheaper than to copy twice
[bytes]."""


def float_view(array: NDArray[np.float64]) -> "memoryview[float]":
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
    """A copy of some arrays that can be put back.

    Arrays that lie next to each other, as those of mjData's state do, are saved in one piece; only they themselves are
    put back.

    Args:
        arrays: Contiguous, and they must stay where they are.
    """

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        self._arrays = sorted((array for array in arrays if array.size), key=lambda array: array.ctypes.data)
        self._saves: list[tuple[memoryview[int], memoryview[int]]] = []
        self._restores: list[tuple[memoryview[int], memoryview[int]]] = []
        for run in _runs(self._arrays):
            begin, end = run[0].ctypes.data, run[-1].ctypes.data + run[-1].nbytes
            there = memoryview((ctypes.c_ubyte * (end - begin)).from_address(begin)).cast("B")
            copy = memoryview(bytearray(there))
            self._saves.append((there, copy))
            for array in run:
                at = array.ctypes.data - begin
                self._restores.append((array.data.cast("B"), copy[at : at + array.nbytes]))

    def save(self) -> None:
        """Copies the arrays as they are now."""
        for there, copy in self._saves:
            copy[:] = there

    def restore(self) -> None:
        """Puts the copy back."""
        for view, copy in self._restores:
            view[:] = copy


def _runs(arrays: Iterable[NDArray[Any]]) -> list[list[NDArray[Any]]]:
    """Returns arrays, sorted by where they lie, in groups of neighbours."""
    runs: list[list[NDArray[Any]]] = []
    for array in arrays:
        near = runs and array.ctypes.data - (runs[-1][-1].ctypes.data + runs[-1][-1].nbytes) <= _GAP
        if near:
            runs[-1].append(array)
        else:
            runs.append([array])
    return runs
