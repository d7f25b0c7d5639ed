"""The state before the next steps, to which the simulation returns if they diverge. Physics thread only."""

import mujoco

from mjplug.physics import physics_state, sleep
from mjplug.physics.memory import SavedArrays

_CHANGED = ("qpos", "qvel", "act", "qacc_warmstart", "plugin_state", "history")
"""Arrays that a step changes and the next step reads. Some releases of MuJoCo lack some of them."""


class Checkpoint:
    """A copy of everything that steps change and later steps read, except the time.

    Args:
        model: The model.
        data: The state.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        arrays = [getattr(data, name) for name in _CHANGED if hasattr(data, name)]
        self._sleeping: sleep.SleepingResults | None = None
        if sleep.sleeps(model):
            arrays.append(data.tree_asleep)
            self._sleeping = sleep.SleepingResults(model, data, physics_state.result_arrays(data))
        self._arrays = SavedArrays(arrays)

    def save(self) -> None:
        """Copies the present state."""
        self._arrays.save()
        if self._sleeping is not None:
            self._sleeping.save()

    def restore(self) -> bool:
        """Sets the copied state, except the time.

        Returns:
            Whether the derived quantities are those of this state. Otherwise they are those of the last step.
        """
        self._arrays.restore()
        if self._sleeping is None:
            return False
        self._sleeping.restore()
        sleep.derive_awake(self._model, self._data)
        # The quantities of bodies that are awake. A body may wake up, which belongs to the next step.
        mujoco.mj_forward(self._model, self._data)
        self._arrays.restore()
        sleep.derive_awake(self._model, self._data)
        return True
