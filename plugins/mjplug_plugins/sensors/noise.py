"""Gaussian noise with the standard deviations in the model; MuJoCo itself adds no noise."""

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.sensors.model_sensors import Sensor, Source

Array = NDArray[np.float64]

_POSITIVE = {"touch", "insidesite"}
"""Types with a single value that is never negative."""

_UNIT_VECTOR = {"framexaxis", "frameyaxis", "framezaxis", "geomnormal"}


class Noise:
    """Computes the noisy values of a sensor.

    The noise depends on the seed, the sensor and the time only, not on which messages are published.

    Attributes:
        values: Noisy values of each part by role, shape (size,).

    Args:
        sensor: The sensor.
        exact: Its exact values by role, views that change with the state.
        seed: Seed of the noise.
    """

    def __init__(self, sensor: Sensor, exact: Mapping[str, Array], seed: int) -> None:
        key = np.random.SeedSequence((seed, *sensor.kind.encode(), *sensor.name.encode())).generate_state(2, np.uint64)
        self._bits = np.random.Philox(key=key)
        self._start: Any = self._bits.state
        self._random = np.random.Generator(self._bits)
        self.values = {role: np.zeros(source.size) for role, source in sensor.parts.items()}
        # A quaternion has four values but three degrees of freedom.
        free = [3 if source.is_quaternion else source.size for source in sensor.parts.values()]
        self._noise = np.zeros(sum(free))
        self._deviations = np.repeat([source.noise for source in sensor.parts.values()], free)
        shares = np.split(self._noise, np.cumsum(free)[:-1])
        self._parts = [
            (_adder(source), source, exact[role], share, self.values[role])
            for (role, source), share in zip(sensor.parts.items(), shares, strict=True)
        ]

    def draw(self, time_ns: int, lineage: int) -> None:
        """Computes `values` from the current exact values.

        Args:
            time_ns: Time of the values [ns].
            lineage: Number of resets in the past of the state.
        """
        # Setting the counter takes a few microseconds; a new generator would take a hundred.
        self._start["state"]["counter"][:] = (0, 0, time_ns, lineage)
        self._bits.state = self._start
        self._random.standard_normal(out=self._noise)
        np.multiply(self._noise, self._deviations, self._noise)
        for add, source, exact, noise, noisy in self._parts:
            add(source, exact, noise, noisy)


def _adder(source: Source) -> Callable[[Source, Array, Array, Array], object]:
    """Returns a function (source, exact, noise, noisy) that writes the exact values with noise into `noisy`."""
    if source.is_quaternion:
        return _turn
    if source.type == "rangefinder":
        return _add_to_distance
    if source.type in _POSITIVE:
        return _add_to_positive
    return _add_to_direction if source.type in _UNIT_VECTOR else _add


def _add(source: Source, exact: Array, noise: Array, noisy: Array) -> None:
    np.add(exact, noise, noisy)


def _add_to_positive(source: Source, exact: Array, noise: Array, noisy: Array) -> None:
    noisy[0] = max(float(exact[0]) + float(noise[0]), 0.0)


def _add_to_distance(source: Source, exact: Array, noise: Array, noisy: Array) -> None:
    distance = float(exact[0])
    # -1 and the cutoff are not distances; they mean that nothing is in range.
    no_return = distance < 0.0 or 0.0 < source.cutoff <= distance
    noisy[0] = distance if no_return else max(distance + float(noise[0]), 0.0)


def _add_to_direction(source: Source, exact: Array, noise: Array, noisy: Array) -> None:
    np.add(exact, noise, noisy)
    np.divide(noisy, np.linalg.norm(noisy), noisy)


def _turn(source: Source, exact: Array, noise: Array, noisy: Array) -> None:
    # A small rotation about the axes of the sensor.
    noisy[:] = exact
    mujoco.mju_quatIntegrate(noisy, noise, 1.0)
