"""Loads the newest state of a server into the data of a window."""

from time import monotonic

import mujoco

from mjplug.window.errors import WindowError
from mjplug.window.stream import SIGNATURE, State, States

_SILENCE = 3.0
"""The server sends a state at least once a second; it does not answer if there is none for this time [s]."""


class Feed:
    """The states of a server for one window.

    Args:
        name: The server's full name.
        model: The server's model.
        states: The server's states.
    """

    def __init__(self, name: str, model: mujoco.MjModel, states: States) -> None:
        self._name = name
        self._model = model
        self._states = states
        self._size = mujoco.mj_stateSize(model, SIGNATURE)
        self._state: State | None = None
        self._received = monotonic()

    @property
    def silent(self) -> bool:
        """Whether the server has sent nothing for some seconds."""
        return monotonic() - self._received > _SILENCE

    def load(self, data: mujoco.MjData, timeout: float) -> State | None:
        """Sets the newest state in `data` and computes what follows from it.

        Args:
            data: Gets the state; also if it is not new, because a viewer may have changed `data`.
            timeout: How long to wait for a new state [s].

        Returns:
            The state; None if the server has sent none yet.

        Raises:
            WindowError: The state does not fit the model, because the server now has another one.
        """
        state = self._states.next(timeout)
        if state is not None:
            if len(state.values) != self._size:
                raise WindowError(f"{self._name} has another model now; run the command again to see it")
            self._state, self._received = state, monotonic()
        if self._state is not None:
            mujoco.mj_setState(self._model, data, self._state.values, SIGNATURE)
            mujoco.mj_forward(self._model, data)
        return self._state
