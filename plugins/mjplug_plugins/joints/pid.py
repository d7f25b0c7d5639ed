"""PID controllers in a row, computed together before every step, by the law of control_toolbox."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin.bundled import float_view
from mjplug_plugins.joints.parameters import PidGains

Array = NDArray[np.float64]


class PidBank:
    """All PIDs that follow one kind of command, positions or velocities.

    With the error e = setpoint - state, the output is p·e + integral + d·de/dt within the limits; then the integral
    grows by i·e·dt and is kept within its own. The first error after a start has no derivative. Those that are not
    running are computed too, which costs nothing beside the rest, but reach no actuator.

    Attributes:
        count: How many of them run.
        setpoint: Shape (n,); change it through `follow`.

    Args:
        gains: Of each PID.
        state: What is regulated: `qpos` or `qvel`.
        places: Where each PID's joint is in it.
        ctrl: Where the outputs go.
        actuators: The actuator of each PID, a place in `ctrl`.
        limits: The lower and upper limits of each actuator's control, besides those of the gains.
        dt: Time step [s].
    """

    def __init__(
        self,
        gains: Sequence[PidGains],
        state: Array,
        places: Sequence[int],
        ctrl: Array,
        actuators: Sequence[int],
        limits: Sequence[tuple[float, float]],
        dt: float,
    ) -> None:
        count = len(gains)
        self._state, self._places = state, np.array(places, np.intp)
        self._ctrl, self._actuators = ctrl, np.array(actuators, np.intp)
        self._p, self._d_per_dt = _column(gains, "p"), _column(gains, "d") / dt
        self._i_dt = _column(gains, "i") * dt
        bounds = np.array(limits, float).reshape(count, 2)
        self._u_min = np.maximum(_column(gains, "u_clamp_min"), bounds[:, 0])
        self._u_max = np.maximum(np.minimum(_column(gains, "u_clamp_max"), bounds[:, 1]), self._u_min)
        self._i_min, self._i_max = _column(gains, "i_clamp_min"), _column(gains, "i_clamp_max")
        self._deadband = _column(gains, "error_deadband")
        self._conditional = np.array([g.antiwindup_strategy == "conditional_integration" for g in gains], bool)
        self._back = np.array([_back_calculation(g) * dt for g in gains])
        self._plain = not (self._conditional.any() or self._back.any() or self._deadband.any())
        self._integrates = bool(self._i_dt.any())
        self._integral_limited = bool(np.isfinite(self._i_min).any() or np.isfinite(self._i_max).any())
        piece = _piece(self._places)
        self._in_place = None if piece is None else state[piece]
        self.setpoint = np.zeros(count)
        self._setpoints = float_view(self.setpoint)
        self._integral = np.zeros(count)
        self._last = np.zeros(count)
        self._error, self._unlimited, self._derivative, self._outputs = (np.zeros(count) for _ in range(4))
        self._active = [False] * count
        self.count = 0
        self._select()

    def follow(self, pid: int, setpoint: float) -> None:
        """Gives a PID its setpoint, and starts it if it does not run [rad, m, rad/s or m/s]."""
        self._setpoints[pid] = setpoint
        if not self._active[pid]:
            self._integral[pid] = 0.0
            self._last[pid] = setpoint - self._state[self._places[pid]]
            self._active[pid] = self._changed = True
            self.count += 1

    def stop(self, pid: int) -> None:
        """Lets a PID's actuator keep the control that it has."""
        if self._active[pid]:
            self._active[pid], self._changed = False, True
            self.count -= 1

    def stop_all(self) -> None:
        """Stops all of them."""
        self._active = [False] * len(self._active)
        self.count, self._changed = 0, True

    def runs(self, pid: int) -> bool:
        """Returns whether a PID runs."""
        return self._active[pid]

    def update(self) -> None:
        """Writes the controls for the coming step."""
        if self._changed:
            self._select()
        error, output, unlimited = self._error, self._output, self._unlimited
        if self._in_place is None:
            self._state.take(self._places, out=error, mode="clip")
            np.subtract(self.setpoint, error, error)
        else:
            np.subtract(self.setpoint, self._in_place, error)
        np.subtract(error, self._last, self._derivative)
        np.multiply(self._derivative, self._d_per_dt, self._derivative)
        np.multiply(error, self._p, unlimited)
        np.add(unlimited, self._derivative, unlimited)
        if self._integrates:
            np.add(unlimited, self._integral, unlimited)
        np.minimum(unlimited, self._u_max, out=output)
        np.maximum(output, self._u_min, out=output)
        if self._rows is not None:
            self._ctrl[self._targets] = output[self._rows]
        if self._integrates:
            self._integrate()
        self._last, self._error = error, self._last

    def _integrate(self) -> None:
        error, integral = self._error, self._integral
        growth = self._i_dt * error
        if not self._plain:
            surplus = self._output - self._unlimited
            growth += self._back * surplus
            pushing = self._conditional & (surplus != 0.0) & (error * self._unlimited > 0.0)
            growth[pushing | (np.abs(error) <= self._deadband) & (self._deadband > 0.0)] = 0.0
        np.add(integral, growth, integral)
        if self._integral_limited:
            np.minimum(integral, self._i_max, out=integral)
            np.maximum(integral, self._i_min, out=integral)

    def _select(self) -> None:
        """Finds out which outputs go where; not at each start, since a command starts those of many joints."""
        rows = np.flatnonzero(self._active)
        targets = self._actuators[rows]
        piece = _piece(targets)
        self._changed = False
        self._rows: NDArray[np.intp] | None = rows
        self._targets: NDArray[np.intp] | slice = targets if piece is None else piece
        self._output = self._outputs
        if piece is not None and len(rows) == len(self._active):
            # All of them, side by side: they are computed in their place.
            self._rows, self._output = None, self._ctrl[piece]


def _piece(places: NDArray[np.intp]) -> slice | None:
    """Returns places as a slice if they follow each other, as those of a robot's joints mostly do: that is quicker."""
    if len(places) and (np.diff(places) == 1).all():
        return slice(int(places[0]), int(places[-1]) + 1)
    return None


def _column(gains: Sequence[PidGains], name: str) -> Array:
    return np.array([getattr(g, name) for g in gains], float)


def _back_calculation(gains: PidGains) -> float:
    """Returns how fast a limited output pulls the integral back [1/s]; zero if it does not."""
    if gains.antiwindup_strategy != "back_calculation" or not gains.i:
        return 0.0
    default = math.sqrt(gains.d / gains.i) if gains.d else gains.p / gains.i
    constant = gains.tracking_time_constant or default
    return 1.0 / constant if constant else 0.0
