"""Hides what can be looked through, for drawings that show opaque things only.

MuJoCo draws translucent things without writing to the depth buffer, but only in ordinary colours: in a drawing by id
they are as solid as everything else.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

_OPAQUE_FROM = 0.995
"""MuJoCo draws what has this alpha or a larger one as if it were 1."""

_NOTHING = int(mujoco.mjtGeom.mjGEOM_NONE)


def has_translucent(model: mujoco.MjModel) -> bool:
    """Returns whether a scene of this model can contain something translucent."""
    rgbas = (model.geom_rgba, model.site_rgba, model.mat_rgba, model.skin_rgba, model.flex_rgba)
    if any(np.any((rgba[:, 3] > 0.0) & (rgba[:, 3] < _OPAQUE_FROM)) for rgba in rgbas):
        return True
    # Of tendons, a scene contains those with alpha 0 too.
    return bool(np.any(model.tendon_rgba[:, 3] < _OPAQUE_FROM))


@contextmanager
def translucent_hidden(scene: mujoco.MjvScene) -> Iterator[None]:
    """Leaves what is translucent in a scene out of the drawings that are made until the block ends."""
    hidden = [(geom, geom.type) for geom in scene.geoms[: scene.ngeom] if geom.rgba[3] < _OPAQUE_FROM]
    for geom, _ in hidden:
        geom.type = _NOTHING
    try:
        yield
    finally:
        for geom, kind in hidden:
            geom.type = kind
