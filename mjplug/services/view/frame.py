"""The bytes of `@view/frame`: the poses of one state, for clients without MuJoCo. Little-endian throughout."""

import struct

import mujoco
import numpy as np

from mjplug.services.view.moving import moving_bodies

PAUSED = 1
"""Bit of `flags`: the simulation is paused."""

_HEADER = struct.Struct("<ddIIHHHHI")
"""Simulated time [s], wall time [s since 1970], epoch, step (lowest 32 bits), flags, number of bodies, number of
cameras, zero, number of flex vertices."""

_UINT32 = 0xFFFFFFFF


class FrameWriter:
    """Writes frames of one model.

    After the header come float32 numbers: for each moving body its position (3) [m] and orientation (4, w first), for
    each camera its position (3) and rotation matrix (9, row by row), and the position (3) of each flex vertex, all in
    the world frame.

    Args:
        model: The compiled model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._moving = moving_bodies(model)
        bodies, cameras, vertices = len(self._moving), int(model.ncam), int(model.nflexvert)
        self._counts = bodies, cameras, 0, vertices
        self._buffer = bytearray(_HEADER.size + 4 * (7 * bodies + 12 * cameras + 3 * vertices))
        values = np.frombuffer(self._buffer, "<f4", offset=_HEADER.size)
        self._bodies = values[: 7 * bodies].reshape(bodies, 7)
        self._cameras = values[7 * bodies :][: 12 * cameras].reshape(cameras, 12)
        self._vertices = values[7 * bodies + 12 * cameras :].reshape(vertices, 3)

    def write(self, data: mujoco.MjData, time: float, wall_time: float, epoch: int, step: int, flags: int) -> bytes:
        """Returns the frame of a state.

        Args:
            data: The state; its poses are current.
            time: Simulated time [s].
            wall_time: Wall time [s since 1970].
            epoch: Number of resets.
            step: Number of steps.
            flags: `PAUSED` or 0.
        """
        _HEADER.pack_into(self._buffer, 0, time, wall_time, epoch & _UINT32, step & _UINT32, flags, *self._counts)
        self._bodies[:, :3] = data.xpos[self._moving]
        self._bodies[:, 3:] = data.xquat[self._moving]
        self._cameras[:, :3] = data.cam_xpos
        self._cameras[:, 3:] = data.cam_xmat
        if len(self._vertices):
            self._vertices[:] = data.flexvert_xpos
        return bytes(self._buffer)
