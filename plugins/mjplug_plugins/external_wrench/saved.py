"""The active wrenches as data of a saved state."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from mjplug.plugin import Host, RequestError
from mjplug_plugins.external_wrench.wrench import Vec, Wrench, wrench_on

_WHOLE, _REAL = 4, 11
"""Numbers of columns of the two arrays."""

_MAX_STEPS = 1 << 53
"""Largest number of steps between now and start or end of a wrench."""

_MAX_ID = (1 << 31) - 1
"""Numbers of markers are below this; they are int32."""


def saved_wrenches(active: Iterable[tuple[Wrench, int]], shown: Collection[Wrench], step: int) -> dict[str, Any]:
    """Returns wrenches as data.

    Args:
        active: The wrenches with the ids of their markers, in the order of their start.
        shown: Those that have markers.
        step: The present step.

    Returns:
        The names of the bodies; an array with start and end relative to `step`, id, and whether it is shown, shape
        (n, 4); an array with point, force, torque, duration and ramp, shape (n, 11).
    """
    wrenches = list(active)
    whole = [(w.start - step, w.end - step, marker_id, w in shown) for w, marker_id in wrenches]
    real = [(*w.point, *w.force, *w.torque, w.duration, w.ramp) for w, _ in wrenches]
    return {
        "bodies": [wrench.body_name for wrench, _ in wrenches],
        "whole": np.array(whole, np.int64).reshape(-1, _WHOLE),
        "real": np.array(real, np.float64).reshape(-1, _REAL),
    }


def restored_wrenches(host: Host, saved: Mapping[str, Any], most: int) -> tuple[dict[Wrench, int], list[Wrench]]:
    """Returns the wrenches in what `saved_wrenches` has returned, with their ids, and those that are shown.

    Args:
        host: Provides model, state and the present step.
        saved: The data.
        most: Largest number of wrenches.

    Raises:
        RequestError: The data are invalid.
    """
    bodies, whole, real = saved["bodies"], np.asarray(saved["whole"]), np.asarray(saved["real"])
    count = len(bodies)
    if whole.shape != (count, _WHOLE) or real.shape != (count, _REAL) or count > most:
        raise RequestError("the wrenches have other sizes")
    if whole.dtype != np.int64 or real.dtype != np.float64:
        raise RequestError("the wrenches have other types")
    start, end, marker_ids = whole.T[:3]
    if not np.isfinite(real).all() or (real[:, 9:] < 0).any() or (real[:, 10] > real[:, 9]).any():
        raise RequestError("a wrench is invalid")
    if (start > 0).any() or (start < -_MAX_STEPS).any() or (end < 0).any() or (end > _MAX_STEPS).any():
        raise RequestError("a wrench does not act now")
    next_id = saved["next_id"]
    if not isinstance(next_id, int) or not 0 <= next_id < _MAX_ID:
        raise RequestError("the number of the next marker is invalid")
    if ((marker_ids < 0) | (marker_ids >= next_id)).any() or len(set(marker_ids.tolist())) != count:
        raise RequestError("the number of a marker is invalid")
    wrenches: dict[Wrench, int] = {}
    shown = []
    for name, (start, end, marker_id, has_markers), row in zip(bodies, whole.tolist(), real.tolist(), strict=True):
        steps = host.step + start, host.step + end
        wrench = wrench_on(host, name, _vec(row, 0), _vec(row, 3), _vec(row, 6), steps, row[9], row[10])
        wrenches[wrench] = marker_id
        if has_markers:
            shown.append(wrench)
    return wrenches, shown


def _vec(row: list[float], begin: int) -> Vec:
    return row[begin], row[begin + 1], row[begin + 2]
