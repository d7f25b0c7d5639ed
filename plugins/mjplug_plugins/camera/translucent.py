"""Hides translucent objects, for renderings of opaque objects only.

MuJoCo draws translucent objects without writing to the depth buffer, but only in normal rendering. When it renders by
id, it draws them like opaque objects.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

_OPAQUE_ALPHA = 0.995
"""MuJoCo draws objects with this alpha or a larger one as opaque."""

_NO_GEOM = int(mujoco.mjtGeom.mjGEOM_NONE)


def has_translucent(model: mujoco.MjModel) -> bool:
    """Returns whether a scene of this model can contain translucent objects."""
    rgbas = (model.geom_rgba, model.site_rgba, model.mat_rgba, model.skin_rgba, model.flex_rgba)
    if any(np.any((rgba[:, 3] > 0.0) & (rgba[:, 3] < _OPAQUE_ALPHA)) for rgba in rgbas):
        return True
    # A scene contains tendons even if their alpha is 0.
    return bool(np.any(model.tendon_rgba[:, 3] < _OPAQUE_ALPHA))


@contextmanager
def translucent_hidden(scene: mujoco.MjvScene) -> Iterator[None]:
    """Hides the translucent objects of a scene inside the `with` block."""
    hidden = [(geom, geom.type) for geom in scene.geoms[: scene.ngeom] if geom.rgba[3] < _OPAQUE_ALPHA]
    for geom, _ in hidden:
        geom.type = _NO_GEOM
    try:
        yield
    finally:
        for geom, kind in hidden:
            geom.type = kind
