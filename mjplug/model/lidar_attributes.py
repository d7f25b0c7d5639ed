"""Validates the attributes of a `mujoco.plugin.lidar` sensor in a model."""

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from mjplug.errors import ModelError, UnknownName


def validated(written: Mapping[str, str], where: str) -> dict[str, Any]:
    """Returns the values of the attributes.

    Args:
        written: The attributes as text, as in the model.
        where: File, line and sensor, for the error message.

    Raises:
        ModelError: An attribute is missing, unknown or invalid.
    """
    for name in written:
        if name not in _ATTRIBUTES:
            raise ModelError(f"{where}: {UnknownName('attribute', name, _ATTRIBUTES)}")
    values: dict[str, Any] = {}
    for name, (allowed, read) in _ATTRIBUTES.items():
        if name in written:
            numbers = _numbers(written[name])
            value = None if numbers is None else read(numbers)
            if value is None:
                raise ModelError(f"{where}: {name} is {written[name]!r}; it must be {allowed}")
            values[name] = value
        elif name in _REQUIRED:
            raise ModelError(f"{where}: {name} is missing; it must be {allowed}")
    _check_together(values, where)
    return values


def _check_together(values: Mapping[str, Any], where: str) -> None:
    rows, elevations = values["resolution"][1], values["elevation_range"]
    if rows > 1 and len(elevations) == 1:
        raise ModelError(
            f"{where}: elevation_range is {elevations[0]:g}; {rows} rows need two angles, the lower one first"
        )
    low, high = values.get("min_range", 0.0), values["max_range"]
    if high <= low:
        raise ModelError(f"{where}: max_range is {high:g}; it must be greater than min_range, which is {low:g}")


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(part) for part in re.split(r"[\s,]+", text.strip().rstrip(","))]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _resolution(numbers: list[float]) -> list[int] | None:
    whole = all(number >= 1 and number == int(number) for number in numbers)
    return [int(number) for number in numbers] if len(numbers) == 2 and whole else None


def _azimuths(numbers: list[float]) -> list[float] | None:
    return numbers if len(numbers) == 2 and -_PI <= numbers[0] < numbers[1] <= _PI else None


def _elevations(numbers: list[float]) -> list[float] | None:
    one = len(numbers) == 1 and -_PI <= numbers[0] <= _PI
    # Two equal angles are allowed for one row.
    same = len(numbers) == 2 and numbers[0] == numbers[1]
    if one or (same and -_PI <= numbers[0] <= _PI):
        return numbers[:1]
    return _azimuths(numbers)


def _above_zero(numbers: list[float]) -> float | None:
    return numbers[0] if len(numbers) == 1 and numbers[0] > 0 else None


def _not_negative(numbers: list[float]) -> float | None:
    return numbers[0] if len(numbers) == 1 and numbers[0] >= 0 else None


_PI = 3.1416
"""Limit of angles: pi, rounded up because angles in files are rounded [rad]."""

_ATTRIBUTES: dict[str, tuple[str, Callable[[list[float]], Any]]] = {
    "resolution": ("two whole numbers above 0: columns and rows", _resolution),
    "azimuth_range": ("two angles from -pi to pi [rad], the lower one first", _azimuths),
    "elevation_range": ("one angle, or two with the lower one first, from -pi to pi [rad]", _elevations),
    "max_range": ("a number above 0 [m]", _above_zero),
    "min_range": ("a number not below 0 [m]", _not_negative),
    "update_rate": ("a number not below 0 [Hz]; 0 is every step", _not_negative),
    "async": ("a number; other than 0 means yes", lambda numbers: int(numbers[0] != 0) if len(numbers) == 1 else None),
}

_REQUIRED = ("resolution", "azimuth_range", "elevation_range", "max_range")
