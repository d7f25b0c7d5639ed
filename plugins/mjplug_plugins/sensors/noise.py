"""Gaussian noise as the model states it, which MuJoCo itself does not add."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.sensors.found import Sensor, Source

Array = NDArray[np.float64]

_POSITIVE = {"touch", "insidesite"}
_UNIT_VECTOR = {"framexaxis", "frameyaxis", "framezaxis", "geomnormal"}


class Noise:
    """Draws what a noisy sensor says.

    The noise of a message follows from the seed, the sensor and the time, so it does not depend on who listens to what.

    Attributes:
        values: What each part says, by its role.

    Args:
        sensor: The sensor.
        exact: Its exact values by role, arrays that change in place.
        seed: Where the noise starts from.
    """

    def __init__(self, sensor: Sensor, exact: Mapping[str, Array], seed: int) -> None:
        key = np.random.SeedSequence((seed, *sensor.kind.encode(), *sensor.name.encode())).generate_state(2, np.uint64)
        self._bits = np.random.Philox(key=key)
        self._start: Any = self._bits.state
        self._random = np.random.Generator(self._bits)
        self.values = {role: np.zeros(source.size) for role, source in sensor.parts.items()}
        self._parts = [(source, exact[role], self.values[role]) for role, source in sensor.parts.items()]

    def draw(self, time_ns: int, epoch: int) -> None:
        """Brings `values` up to the present ones.

        Args:
            time_ns: Their time [ns].
            epoch: Resets of the world before it.
        """
        # A counter is set in a few microseconds; a new generator takes a hundred.
        self._start["state"]["counter"][:] = (0, 0, time_ns, epoch)
        self._bits.state = self._start
        for source, exact, noisy in self._parts:
            # A turn has three degrees of freedom, though a quaternion has four numbers.
            free = 3 if source.size == 4 else source.size
            noisy[:] = _noisy(source, exact, source.noise * self._random.standard_normal(free))


def _noisy(source: Source, exact: Array, noise: Array) -> Array:
    if source.size == 4:
        # A small turn in the sensor's own axes.
        turn, turned = np.empty(4), np.empty(4)
        angle = float(np.linalg.norm(noise))
        mujoco.mju_axisAngle2Quat(turn, noise / angle if angle else np.array((1.0, 0.0, 0.0)), angle)
        mujoco.mju_mulQuat(turned, exact, turn)
        return turned
    noisy = exact + noise
    if source.type in _POSITIVE:
        return np.maximum(noisy, 0.0)
    if source.type == "rangefinder":
        # -1 is no distance but says that there is nothing.
        return np.where(exact < 0.0, exact, np.maximum(noisy, 0.0))
    if source.type in _UNIT_VECTOR:
        return noisy / np.linalg.norm(noisy)
    return noisy
