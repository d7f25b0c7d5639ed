"""PIDs of actuators that transmissions derive from joints: their efforts act on the joints."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.joints.outputs import MAX_VALUE, DirectOutput
from mjplug_plugins.joints.parameters import PidGains
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.transmission import Interface, Relation, index_of

Array = NDArray[np.float64]


class DerivedEfforts:
    """The efforts of the derived side of one transmission, which PIDs write and joints get.

    Attributes:
        values: The efforts, shape (n,) [N·m or N].

    Args:
        relation: The transmission.
        outputs: The effort outputs of each joint of the model.
    """

    def __init__(self, relation: Relation, outputs: Sequence[Sequence[DirectOutput]]) -> None:
        self.values = np.zeros(len(outputs))
        self._matrix = relation.to_real["effort"][0]
        self._outputs = outputs

    def write(self) -> None:
        """Sets the controls of the joints' actuators."""
        for outputs, effort in zip(self._outputs, (self._matrix @ self.values).tolist(), strict=True):
            for output in outputs:
                output.write(effort)


class DerivedPidBank(PidBank):
    """The position or velocity PIDs of one transmission's derived side.

    Args:
        gains: Gains of each PID.
        interface: What the PIDs control.
        relation: The transmission.
        state: The array of the state, `qpos` or `qvel`.
        efforts: Gets the outputs.
        dt: Time step [s].
    """

    def __init__(
        self,
        gains: Sequence[PidGains],
        interface: Interface,
        relation: Relation,
        state: Array,
        efforts: DerivedEfforts,
        dt: float,
    ) -> None:
        self._matrix, self._offset = relation.to_derived[interface]
        self._source = state
        self._joints = np.array([index_of(joint, interface) for joint in relation.real], np.intp)
        self._derived = np.zeros(len(gains))
        self._efforts = efforts
        rows = range(len(gains))
        super().__init__(gains, self._derived, rows, efforts.values, rows, [(-MAX_VALUE, MAX_VALUE)] * len(gains), dt)

    def follow(self, pid: int, setpoint: float) -> None:
        """Sets the setpoint [rad, m, rad/s or m/s] of a PID, and starts the PID if it is not running."""
        self._measure()
        super().follow(pid, setpoint)

    def update(self) -> None:
        """Writes the controls for the next step."""
        self._measure()
        super().update()
        self._efforts.write()

    def stop(self, pid: int) -> None:
        """Stops a PID; its actuator has no effort then."""
        super().stop(pid)
        self._efforts.values[pid] = 0.0

    def stop_all(self) -> None:
        """Stops all PIDs."""
        super().stop_all()
        self._efforts.values[:] = 0.0

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets what `save` has returned."""
        self._efforts.values[:] = 0.0
        super().restore(saved)

    def _measure(self) -> None:
        np.add(self._matrix @ self._source[self._joints], self._offset, self._derived)
