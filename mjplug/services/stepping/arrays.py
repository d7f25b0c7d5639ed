"""The arrays of mjData that clients can observe, and copies of them after each action."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError, UnknownName
from mjplug.near_names import Names
from mjplug.physics.memory import float_view
from mjplug.physics.simulation import Simulation

_STATE = ("qpos", "qvel", "act", "ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat", "userdata")
"""Arrays of the state after the steps."""

_POSES = (
    "xpos",
    "xquat",
    "xmat",
    "xipos",
    "ximat",
    "xanchor",
    "xaxis",
    "geom_xpos",
    "geom_xmat",
    "site_xpos",
    "site_xmat",
)
"""Arrays that `Simulation.kinematics` computes from the positions after the steps."""

_LAST_STEP = (
    "qacc",
    "act_dot",
    "sensordata",
    "actuator_length",
    "actuator_velocity",
    "actuator_force",
    "qfrc_actuator",
    "qfrc_passive",
    "qfrc_bias",
    "qfrc_constraint",
    "ten_length",
    "ten_velocity",
    "cvel",
    "cam_xpos",
    "cam_xmat",
    "subtree_com",
    "subtree_linvel",
    "subtree_angmom",
    "energy",
)
"""Arrays that the last step computed before it integrated, as after `mj_step`."""

_EXTERNAL_FORCES = "cfrc_ext"
"""Forces of contacts and of plugins on each body in the last step. MuJoCo computes them only if a sensor needs them."""

OBSERVABLE = (*_STATE, *_POSES, *_LAST_STEP, _EXTERNAL_FORCES)
"""The arrays that clients can observe."""

MAX_ARRAYS = 64
"""Maximum number of arrays in a request."""

MAX_VALUES = 1 << 21
"""Maximum number of values in a response; 16 MiB in CDR."""

MAX_JSON_VALUES = 4096
"""Maximum number of values in a JSON response, because physics waits while it is encoded."""

_KNOWN = Names(OBSERVABLE)


class Observed:
    """Some arrays of mjData, one after the other, and the controls.

    Attributes:
        widths: Number of values of each array.
        width: Number of values of all arrays.
        ctrl: The controls, to be written.
        nu: Number of controls.

    Args:
        simulation: The model and its state.
        names: Names of the arrays; a name may appear several times.

    Raises:
        RequestError: There are too many names, or a name is not one of `OBSERVABLE`.
    """

    def __init__(self, simulation: Simulation, names: Sequence[str]) -> None:
        if len(names) > MAX_ARRAYS:
            raise RequestError(f"observe has {len(names)} names; at most {MAX_ARRAYS} are accepted")
        for name in names:
            if name not in OBSERVABLE:
                raise UnknownName("array in observe", name, _KNOWN)
        self._simulation = simulation
        self.ctrl, self.nu = float_view(simulation.data.ctrl), simulation.model.nu
        arrays: list[NDArray[np.float64]] = [getattr(simulation.data, name) for name in names]
        self.widths = tuple(array.size for array in arrays)
        self.width = sum(self.widths)
        self._copies: list[tuple[int, int, memoryview[float]]] = []
        begin = 0
        for array in arrays:
            if array.size:
                self._copies.append((begin, begin + array.size, float_view(array)))
            begin += array.size
        self._forces = _EXTERNAL_FORCES in names
        self._poses = any(name in _POSES for name in names)

    def copy_to(self, rows: "memoryview[float]", begin: int) -> None:
        """Copies the present values.

        Args:
            rows: Where the values are written.
            begin: Index of the first value.
        """
        if self._forces:
            # Before the poses are updated, because the forces belong to the same instant as the last step's results.
            mujoco.mj_rnePostConstraint(self._simulation.model, self._simulation.data)
        if self._poses:
            self._simulation.kinematics()
        for first, end, values in self._copies:
            rows[begin + first : begin + end] = values


def check_count(values: int, form: str) -> None:
    """Checks the number of values in a response.

    Args:
        values: Number of values.
        form: `cdr` or `json`.

    Raises:
        RequestError: There are too many.
    """
    most, hint = (MAX_JSON_VALUES, " in JSON; send CDR") if form == "json" else (MAX_VALUES, "; send fewer actions")
    if values > most:
        raise RequestError(f"the response would contain {values} observed values; at most {most} are possible{hint}")
