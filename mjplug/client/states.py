"""Saved states, for every client that can call services."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from mjplug.client.types import as_message
from mjplug_schemas.message import Message
from mjplug_schemas.mjplug_msgs import RestoreState, SaveState, Snapshot
from mjplug_schemas.mujoco_ros2_control_msgs import ResetWorld


class StateCalls(ABC):
    """Resets the world, saves and restores states, by calls of services."""

    @abstractmethod
    def call(self, name: str, message: Any = None, *, timeout: float | None = None) -> Any:
        """Calls a service and returns its response."""

    @abstractmethod
    def _call_with(self, parameters: Mapping[str, str], name: str, request: Message, timeout: float | None) -> Any:
        """Calls a service with parameters of the selector, and returns its response."""

    def reset(
        self,
        *,
        keyframe: str = "",
        state_overrides: Any = None,
        episode: int | None = None,
        timeout: float | None = None,
    ) -> None:
        """Resets the world.

        Args:
            keyframe: Name or index of a keyframe; empty means the initial state.
            state_overrides: States of joints and free bodies to set afterwards: a `SimulationState`, or nested
                dictionaries of its fields.
            episode: A whole number on which noise and random numbers of the server depend; simulated time begins at 0.
                What follows is the same, bit by bit, after each reset with the same arguments. None lets simulated
                time continue, with new noise.
            timeout: How long to wait [s]; None is 10 s.

        Raises:
            RequestRefused: The world was not reset.
            TimedOutError: No response arrived in time.
        """
        overrides = {} if state_overrides is None else {"state_overrides": state_overrides}
        request = as_message({"keyframe": keyframe, **overrides}, ResetWorld.Request)
        self._call_with(_parameters(episode), "~/reset_world", request, timeout)

    def save(self, name: str, *, file: bool = False, overwrite: bool = False, timeout: float | None = None) -> Snapshot:
        """Saves the state of the simulation with its plugins.

        Args:
            name: The name of the state: letters, digits and underscores.
            file: Whether to write it to a file on the machine of the server; otherwise it is in the server's memory.
            overwrite: Whether to replace a state of the same name.
            timeout: How long to wait [s]; None is 10 s.

        Returns:
            The description of the state; `left_out` names plugin instances whose state is not in it.

        Raises:
            RequestRefused: The state was not saved.
            TimedOutError: No response arrived in time.
        """
        request = SaveState.Request(name=name, file=file, overwrite=overwrite)
        snapshot: Snapshot = self.call("~/save_state", request, timeout=timeout).snapshot
        return snapshot

    def restore(
        self,
        name: str,
        *,
        file: bool = False,
        strict: bool = False,
        keep_time: bool = False,
        episode: int | None = None,
        timeout: float | None = None,
    ) -> Snapshot:
        """Restores a saved state.

        Args:
            name: The name of the state.
            file: Whether it is in a file; otherwise it is in the server's memory.
            strict: Whether to refuse if the state of a plugin cannot be restored.
            keep_time: Whether simulated time continues; otherwise it is that of the saved state.
            episode: A whole number on which noise and random numbers of the server depend; None for those of the state.
            timeout: How long to wait [s]; None is 10 s.

        Returns:
            The description of the state; `left_out` names plugin instances whose state was not restored.

        Raises:
            RequestRefused: The state was not restored; nothing has changed.
            TimedOutError: No response arrived in time.
        """
        request = RestoreState.Request(name=name, file=file, strict=strict, keep_time=keep_time)
        response = self._call_with(_parameters(episode), "~/restore_state", request, timeout)
        snapshot: Snapshot = response.snapshot
        return snapshot

    def fork(self, other: "StateCalls", name: str = "fork") -> Snapshot:
        """Gives another server the state of this one, through a file in a folder that both use.

        The servers need the same model and the same `snapshots.folder`. Both then continue equally, step by step.

        Args:
            other: A client of the other server.
            name: The name of the file's state; a state of this name is replaced.

        Returns:
            The description of the state.

        Raises:
            RequestRefused: The state was not saved, or the other server cannot restore it completely.
            TimedOutError: No response arrived in time.
        """
        self.save(name, file=True, overwrite=True)
        return other.restore(name, file=True, strict=True)


def _parameters(episode: int | None) -> dict[str, str]:
    return {} if episode is None else {"episode": str(episode)}
