"""Values of a model that clients change while the simulation runs: friction, masses, gains, colours and so on."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mjplug.errors import RequestError, UnknownName, quoted

OPTION = "option"
"""The element that contains the options of the model."""

_TYPES: Mapping[str, mujoco.mjtObj] = {
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "light": mujoco.mjtObj.mjOBJ_LIGHT,
    "material": mujoco.mjtObj.mjOBJ_MATERIAL,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
}

ATTRIBUTES: Mapping[str, Mapping[str, int]] = {
    OPTION: {"gravity": 3, "wind": 3, "density": 1, "viscosity": 1, "magnetic": 3},
    "actuator": {"kp": 1, "kv": 1, "gear": 6, "ctrlrange": 2, "forcerange": 2, "gainprm": 10, "biasprm": 10},
    "body": {"mass": 1, "gravcomp": 1},
    "geom": {
        "friction": 3, "size": 3, "rgba": 4, "mass": 1, "density": 1, "margin": 1, "gap": 1, "solref": 2, "solimp": 5,
    },
    "joint": {"damping": 1, "stiffness": 1, "armature": 1, "frictionloss": 1, "range": 2},
    "light": {"diffuse": 3, "ambient": 3, "specular": 3, "pos": 3, "dir": 3},
    "material": {"rgba": 4, "emission": 1, "specular": 1, "shininess": 1, "reflectance": 1},
    "site": {"rgba": 4, "size": 3},
    "tendon": {"damping": 1, "stiffness": 1, "frictionloss": 1, "rgba": 4, "width": 1},
}  # fmt: skip
"""The attributes that can be changed, by kind of element, with the largest number of values, as in MJCF."""


@dataclass(frozen=True, slots=True)
class Value:
    """A changed value.

    Attributes:
        kind: Kind of the element, a key of `ATTRIBUTES`.
        name: Its name; empty for `option`.
        attribute: The attribute.
        values: The values, in the units of MJCF with angles in radians.
    """

    kind: str
    name: str
    attribute: str
    values: tuple[float, ...]

    @property
    def place(self) -> tuple[str, str, str]:
        """Which value it is."""
        return self.kind, self.name, self.attribute


def checked(element: str, attribute: str, values: Sequence[float]) -> Value:
    """Checks a value as far as it is possible without the model.

    Args:
        element: `option`, or the kind and name of an element: `geom/floor`.
        attribute: The attribute.
        values: The values.

    Raises:
        RequestError: It is not valid.
    """
    kind, _, name = element.partition("/")
    if kind not in ATTRIBUTES:
        raise UnknownName("kind of element", kind, ATTRIBUTES)
    if bool(name) == (kind == OPTION):
        raise RequestError(f"element is {quoted(element)}; write 'option', or kind and name as in 'geom/floor'")
    attributes = ATTRIBUTES[kind]
    if attribute not in attributes:
        raise UnknownName(f"attribute of {kind}", attribute, attributes)
    most = attributes[attribute]
    # Friction and size have fewer values for some kinds of geoms.
    fewer = attribute in ("friction", "size", "gainprm", "biasprm", "gear", "solimp", "solref")
    if not (1 <= len(values) <= most if fewer else len(values) == most):
        raise RequestError(f"{attribute} has {len(values)} values; it needs {'up to ' if fewer else ''}{most}")
    if not all(math.isfinite(value) and abs(value) < mujoco.mjMAXVAL for value in values):
        raise RequestError(f"{attribute} is {list(values)}; all values must be finite and below {mujoco.mjMAXVAL:g}")
    return Value(kind, name, attribute, tuple(map(float, values)))


def check_exists(model: mujoco.MjModel, value: Value) -> None:
    """Checks whether a model has the element of a value.

    Raises:
        UnknownName: It has not.
    """
    if value.kind == OPTION:
        return
    type_ = _TYPES[value.kind]
    if mujoco.mj_name2id(model, type_, value.name) < 0:
        count = {"actuator": "nu", "joint": "njnt", "material": "nmat", "body": "nbody"}.get(
            value.kind, f"n{value.kind}"
        )
        names = [mujoco.mj_id2name(model, type_, i) or "" for i in range(getattr(model, count))]
        raise UnknownName(value.kind, value.name, names)


def apply(spec: mujoco.MjSpec, value: Value) -> None:
    """Sets a value in a model that is composed; does nothing if the element is gone.

    Raises:
        RequestError: The element cannot have this value.
    """
    element: Any = spec.option if value.kind == OPTION else getattr(spec, value.kind)(value.name)
    if element is None:
        return
    if value.kind == "actuator" and value.attribute in ("kp", "kv"):
        _set_gain(element, value)
    elif value.kind == "body" and value.attribute == "mass":
        _set_mass(element, value)
    else:
        present = getattr(element, value.attribute)
        if isinstance(present, np.ndarray):
            changed = present.copy()
            changed[: len(value.values)] = value.values
            setattr(element, value.attribute, changed)
        else:
            setattr(element, value.attribute, type(present)(value.values[0]))


def _set_gain(actuator: Any, value: Value) -> None:
    """Sets the gain of a servo as MJCF's shortcuts `position` and `velocity` do."""
    (gain,) = value.values
    gains, biases = actuator.gainprm.copy(), actuator.biasprm.copy()
    if actuator.biastype != mujoco.mjtBias.mjBIAS_AFFINE or actuator.gaintype != mujoco.mjtGain.mjGAIN_FIXED:
        raise RequestError(f"actuator {value.name!r} is no servo; set its gainprm and biasprm")
    drives_position = bool(biases[1])
    if value.attribute == "kp":
        if not drives_position:
            raise RequestError(f"actuator {value.name!r} is no position servo, so it has no kp")
        gains[0], biases[1] = gain, -gain
    else:
        biases[2] = -gain
        if not drives_position:
            gains[0] = gain
    actuator.gainprm, actuator.biasprm = gains, biases


def _set_mass(body: Any, value: Value) -> None:
    """Sets the mass of a body with an `inertial` element, and scales its inertia."""
    (mass,) = value.values
    if not body.explicitinertial:
        raise RequestError(f"the mass of body {value.name!r} follows from its geoms; set their mass instead")
    if mass <= 0 or not body.mass > 0:
        raise RequestError(f"the mass of body {value.name!r} is {mass:g}; it must be positive")
    scale = mass / body.mass
    body.mass = mass
    for name in ("inertia", "fullinertia"):
        present = getattr(body, name).copy()
        # NaN means that the other form is given.
        setattr(body, name, present * scale)
