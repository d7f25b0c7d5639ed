"""The bytes of `@view/overlay/<kind>`: what MuJoCo draws in addition to the bodies. Little-endian throughout."""

import struct
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from mjplug.physics.body_spring import Grip
from mjplug.physics.frames import compose

_FLAG, _FRAME = mujoco.mjtVisFlag, mujoco.mjtFrame

PERTURBATION: Final = "perturbation"
"""The kind of overlay that shows what viewers drag, and where to."""

KINDS: Final = {
    "contacts": (_FLAG.mjVIS_CONTACTPOINT,),
    "contact_forces": (_FLAG.mjVIS_CONTACTFORCE,),
    "tendons": (_FLAG.mjVIS_TENDON,),
    "joints": (_FLAG.mjVIS_JOINT,),
    "actuators": (_FLAG.mjVIS_ACTUATOR,),
    "com": (_FLAG.mjVIS_COM,),
    "inertia": (_FLAG.mjVIS_INERTIA,),
    "rangefinders": (_FLAG.mjVIS_RANGEFINDER,),
    "frames": (),
    PERTURBATION: (_FLAG.mjVIS_PERTFORCE, _FLAG.mjVIS_PERTOBJ, _FLAG.mjVIS_SELECT),
}
"""MuJoCo's visualisation flags of each kind; body frames have none."""

MAX_SHAPES = 2000
"""Maximum number of shapes in an overlay; the others are left out."""

_HEADER = struct.Struct("<dII")
"""Simulated time [s], epoch, number of shapes."""

_SHAPE = np.dtype([("pos", "<f4", 3), ("mat", "<f4", 9), ("size", "<f4", 3), ("rgba", "u1", 4), ("type", "<u4")])


class OverlayWriter:
    """Writes overlays of one model.

    Args:
        model: The compiled model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._scene = mujoco.MjvScene(model, MAX_SHAPES)
        self._camera = mujoco.MjvCamera()
        self._options = {kind: _option(kind) for kind in KINDS}
        self._shapes = np.zeros(MAX_SHAPES, _SHAPE)

    def write(self, data: mujoco.MjData, kind: str, time: float, epoch: int, grips: Sequence[Grip] = ()) -> bytes:
        """Returns the overlay of a state.

        Args:
            data: The state; contacts and forces are current.
            kind: One of `KINDS`.
            time: Simulated time [s].
            epoch: Number of resets.
            grips: What viewers drag; drawn by `perturbation`.
        """
        scene, shapes = self._scene, self._shapes
        every = mujoco.mjtCatBit.mjCAT_ALL
        if kind == PERTURBATION:
            scene.ngeom = 0
            for grip in grips:
                perturbation, decoration = self._perturbation(grip), mujoco.mjtCatBit.mjCAT_DECOR
                mujoco.mjv_addGeoms(self._model, data, self._options[kind], perturbation, decoration, scene)
        else:
            mujoco.mjv_updateScene(self._model, data, self._options[kind], None, self._camera, every, scene)
        count = int(scene.ngeom)
        for index in range(count):
            geom = scene.geoms[index]
            rgba = np.clip(255.0 * geom.rgba, 0.0, 255.0)
            shapes[index] = geom.pos, geom.mat.ravel(), geom.size, rgba, geom.type
        return _HEADER.pack(time, epoch & 0xFFFFFFFF, count) + shapes[:count].tobytes()

    def _perturbation(self, grip: Grip) -> mujoco.MjvPerturb:
        body, point, target, quat = grip
        perturbation = mujoco.MjvPerturb()
        perturbation.select, perturbation.flexselect, perturbation.skinselect = body, -1, -1
        perturbation.localpos = point
        if target is not None:
            perturbation.active |= int(mujoco.mjtPertBit.mjPERT_TRANSLATE)
            perturbation.refselpos = target
        if quat is not None:
            perturbation.active |= int(mujoco.mjtPertBit.mjPERT_ROTATE)
            perturbation.refquat = compose(np.array(quat), self._model.body_iquat[body])
        return perturbation


def _option(kind: str) -> mujoco.MjvOption:
    """Returns options with which a scene contains one kind of overlay and no bodies."""
    option = mujoco.MjvOption()
    option.flags[:] = 0
    for groups in (option.geomgroup, option.sitegroup, option.skingroup, option.flexgroup):
        groups[:] = 0
    for groups in (option.jointgroup, option.tendongroup, option.actuatorgroup):
        groups[:] = 1
    if kind == "frames":
        option.frame = int(_FRAME.mjFRAME_BODY)
    for flag in KINDS[kind]:
        option.flags[int(flag)] = 1
    return option
