"""Saved states, for every client that can call services."""

from abc import ABC, abstractmethod
from typing import Any

from mjplug_schemas.mjplug_msgs import RestoreState, SaveState, Snapshot


class StateCalls(ABC):
    """Saves and restores states, by calls of services."""

    @abstractmethod
    def call(self, name: str, message: Any = None, *, timeout: float | None = None) -> Any:
        """Calls a service and returns its response."""

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
        timeout: float | None = None,
    ) -> Snapshot:
        """Restores a saved state.

        Args:
            name: The name of the state.
            file: Whether it is in a file; otherwise it is in the server's memory.
            strict: Whether to refuse if the state of a plugin cannot be restored.
            keep_time: Whether simulated time continues; otherwise it is that of the saved state.
            timeout: How long to wait [s]; None is 10 s.

        Returns:
            The description of the state; `left_out` names plugin instances whose state was not restored.

        Raises:
            RequestRefused: The state was not restored; nothing has changed.
            TimedOutError: No response arrived in time.
        """
        request = RestoreState.Request(name=name, file=file, strict=strict, keep_time=keep_time)
        snapshot: Snapshot = self.call("~/restore_state", request, timeout=timeout).snapshot
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
