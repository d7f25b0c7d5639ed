"""The bytes of `@view/state`: MuJoCo's own state, for clients with the same version of MuJoCo. Little-endian."""

import struct

import mujoco
import numpy as np

from mjplug.physics import snapshot

_HEADER = struct.Struct("<ddIIHHI")
"""Simulated time [s], wall time [s since 1970], epoch, step (lowest 32 bits), flags, zero, number of values."""

_UINT32 = 0xFFFFFFFF


class StateWriter:
    """Writes states of one model: `mjSTATE_INTEGRATION` as float64 after the header.

    Args:
        model: The compiled model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._values = np.empty(snapshot.size(model))

    def write(self, data: mujoco.MjData, time: float, wall_time: float, epoch: int, step: int, flags: int) -> bytes:
        """Returns the bytes of a state.

        Args:
            data: The state.
            time: Simulated time [s].
            wall_time: Wall time [s since 1970].
            epoch: Number of resets.
            step: Number of steps.
            flags: `frame.PAUSED` or 0.
        """
        snapshot.take(self._model, data, self._values)
        header = _HEADER.pack(time, wall_time, epoch & _UINT32, step & _UINT32, flags, 0, len(self._values))
        return header + self._values.astype("<f8", copy=False).tobytes()
