"""PID controllers that are computed together before every step, with the control law of control_toolbox."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin.bundled import float_view
from mjplug_plugins.joints.parameters import PidGains

Array = NDArray[np.float64]

_LARGEST = 1e100
"""Limit for the numbers of a saved state; products of larger ones with gains could overflow."""


class PidBank:
    """All PIDs for one kind of command, position or velocity.

    With the error e = setpoint - state, the output is p·e + integral + d·de/dt, limited. Then the integral grows by
    i·e·dt and is limited too. The derivative of the first error after a start is zero. PIDs that are not running are
    computed too, because this is faster than skipping them, but their outputs are not used.

    Attributes:
        count: Number of running PIDs.
        setpoint: Setpoints, shape (n,) [rad, m, rad/s or m/s]; call `follow` to change them.

    Args:
        gains: Gains of each PID.
        state: The controlled array, `qpos` or `qvel`.
        indices: Index of each PID's joint in `state`.
        ctrl: The array `ctrl` of the state, shape (nu,); it gets the outputs.
        actuators: Id of the actuator of each PID.
        limits: Lowest and highest control of each actuator, in addition to the limits in the gains.
        dt: Time step [s].
    """

    def __init__(
        self,
        gains: Sequence[PidGains],
        state: Array,
        indices: Sequence[int],
        ctrl: Array,
        actuators: Sequence[int],
        limits: Sequence[tuple[float, float]],
        dt: float,
    ) -> None:
        count = len(gains)
        self._gains, self._dt = list(gains), dt
        self._state, self._indices = state, np.array(indices, np.intp)
        self._ctrl, self._actuators = ctrl, np.array(actuators, np.intp)
        self._bounds = np.array(limits, float).reshape(count, 2)
        self._integral = np.zeros(count)
        self._gains_changed = True
        block = _contiguous(self._indices)
        self._in_place = None if block is None else state[block]
        self.setpoint = np.zeros(count)
        self._setpoints = float_view(self.setpoint)
        self._last = np.zeros(count)
        self._error, self._unlimited, self._derivative, self._outputs = (np.zeros(count) for _ in range(4))
        self._active = [False] * count
        self.count = 0
        self._select()

    def follow(self, pid: int, setpoint: float) -> None:
        """Sets the setpoint [rad, m, rad/s or m/s] of a PID, and starts the PID if it is not running."""
        self._setpoints[pid] = setpoint
        if not self._active[pid]:
            self._integral[pid] = 0.0
            self._last[pid] = setpoint - self._state[self._indices[pid]]
            self._active[pid] = self._changed = True
            self.count += 1

    def set_gains(self, pid: int, gains: PidGains) -> None:
        """Changes the gains of a PID from the next step on; its integral stays, so that the output does not jump."""
        self._gains[pid] = gains
        # The gains are read in `update`, because one request may change those of many PIDs.
        self._gains_changed = self._changed = True

    def stop(self, pid: int) -> None:
        """Stops a PID; its actuator keeps the control."""
        if self._active[pid]:
            self._active[pid], self._changed = False, True
            self.count -= 1

    def stop_all(self) -> None:
        """Stops all PIDs."""
        self._active = [False] * len(self._active)
        self.count, self._changed = 0, True

    def save(self) -> dict[str, NDArray[Any]]:
        """Returns all that later outputs depend on, except the gains."""
        return {
            "setpoint": self.setpoint,
            "integral": self._integral,
            "last": self._last,
            "active": np.array(self._active, bool),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets what `save` has returned."""
        self.setpoint[:], self._integral[:], self._last[:] = saved["setpoint"], saved["integral"], saved["last"]
        self._active = saved["active"].tolist()
        self.count, self._changed = sum(self._active), True

    def fits(self, saved: Mapping[str, Any]) -> bool:
        """Returns whether `restore` accepts a state."""
        return all(
            isinstance(array := saved.get(name), np.ndarray)
            and (array.shape, array.dtype) == (own.shape, own.dtype)
            and bool((np.abs(array) <= _LARGEST).all())
            for name, own in self.save().items()
        )

    def runs(self, pid: int) -> bool:
        """Returns whether a PID is running."""
        return self._active[pid]

    def update(self) -> None:
        """Writes the controls for the next step."""
        if self._changed:
            self._select()
        error, output, unlimited = self._error, self._output, self._unlimited
        if self._in_place is None:
            self._state.take(self._indices, out=error, mode="clip")
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

    def _read_gains(self) -> None:
        self._gains_changed = False
        gains, dt, bounds = self._gains, self._dt, self._bounds
        self._p, self._d_per_dt = _column(gains, "p"), _column(gains, "d") / dt
        self._i_dt = _column(gains, "i") * dt
        self._u_min = np.maximum(_column(gains, "u_clamp_min"), bounds[:, 0])
        self._u_max = np.maximum(np.minimum(_column(gains, "u_clamp_max"), bounds[:, 1]), self._u_min)
        self._i_min, self._i_max = _column(gains, "i_clamp_min"), _column(gains, "i_clamp_max")
        self._deadband = _column(gains, "error_deadband")
        self._conditional = np.array([g.antiwindup_strategy == "conditional_integration" for g in gains], bool)
        self._back_gain = np.array([_back_calculation(g, dt) for g in gains])
        self._no_antiwindup = not (self._conditional.any() or self._back_gain.any() or self._deadband.any())
        # An integral from before the gain became zero still counts.
        self._integrates = bool(self._i_dt.any() or self._integral.any())
        self._integral_limited = bool(np.isfinite(self._i_min).any() or np.isfinite(self._i_max).any())

    def _integrate(self) -> None:
        error, integral = self._error, self._integral
        growth = self._i_dt * error
        if not self._no_antiwindup:
            excess = self._output - self._unlimited
            growth += self._back_gain * excess
            winding_up = self._conditional & (excess != 0.0) & (error * self._unlimited > 0.0)
            growth[winding_up | (np.abs(error) <= self._deadband) & (self._deadband > 0.0)] = 0.0
        np.add(integral, growth, integral)
        if self._integral_limited:
            np.minimum(integral, self._i_max, out=integral)
            np.maximum(integral, self._i_min, out=integral)

    def _select(self) -> None:
        """Selects the outputs to write; deferred to `update`, because one command starts the PIDs of many joints."""
        if self._gains_changed:
            self._read_gains()
        rows = np.flatnonzero(self._active)
        targets = self._actuators[rows]
        block = _contiguous(targets)
        self._changed = False
        self._rows: NDArray[np.intp] | None = rows
        self._targets: NDArray[np.intp] | slice = targets if block is None else block
        self._output = self._outputs
        if block is not None and len(rows) == len(self._active):
            # All PIDs run and their controls are contiguous, so the outputs are computed directly in `ctrl`.
            self._rows, self._output = None, self._ctrl[block]


def _contiguous(indices: NDArray[np.intp]) -> slice | None:
    """Returns indices as a slice if they are contiguous, which is faster and common for robots; else None."""
    if len(indices) and (np.diff(indices) == 1).all():
        return slice(int(indices[0]), int(indices[-1]) + 1)
    return None


def _column(gains: Sequence[PidGains], name: str) -> Array:
    return np.array([getattr(g, name) for g in gains], float)


def _back_calculation(gains: PidGains, dt: float) -> float:
    """Returns the time step divided by the time constant of back calculation, 0 to 1; zero without back calculation.

    A time constant below the time step has the effect of the time step, because the integral would oscillate and grow.
    """
    if gains.antiwindup_strategy != "back_calculation" or not gains.i:
        return 0.0
    constant = gains.tracking_time_constant
    if not constant:
        constant = math.sqrt(gains.d / gains.i) if gains.d else gains.p / gains.i
    return dt / max(constant, dt) if constant else 0.0
