"""`~/save_state`, `~/restore_state`, `~/list_states`, `~/delete_state`, `~/get_state_digest`."""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError, UnknownName
from mjplug.physics.loop import Loop
from mjplug.physics.scheduler import Wait
from mjplug.plugin import Call, Host, Slow
from mjplug.printable import one_line
from mjplug.services.episode import episode_in
from mjplug.services.states.file_thread import FileThread
from mjplug.services.states.keeper import Keeper, listing
from mjplug.services.states.saved_state import SavedState, describe
from mjplug.services.states.state_files import StateFiles, check_name
from mjplug_schemas.mjplug_msgs import (
    DeleteState,
    GetStateDigest,
    ListStates,
    RestoreState,
    SaveState,
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of saved states, for those in memory and again for those in files.

    Attributes:
        max_states: Maximum number of states.
        max_bytes: Maximum size of all states [bytes].
    """

    max_states: int = 64
    max_bytes: int = 256 << 20


def offer(host: Host, loop: Loop, seed: int, version: str, limits: Limits, folder: Path | None) -> "States":
    """Declares the services. Call it before plugins start.

    Args:
        host: The host of the server.
        loop: The physics loop.
        seed: The setting `sim.seed`.
        version: The version of mjplug.
        limits: Limits in memory, and in the folder.
        folder: The folder of files; None if there is none.

    Returns:
        The saved states.
    """
    thread = FileThread(loop.inbox)
    states = States(Keeper(loop, seed, version), host, limits, folder, thread)
    host.create_service(SaveState, "~/save_state", states.save)
    host.create_service(RestoreState, "~/restore_state", states.restore)
    host.create_service(ListStates, "~/list_states", states.list)
    host.create_service(DeleteState, "~/delete_state", states.delete)
    host.create_service(GetStateDigest, "~/get_state_digest", states.digest)
    return states


class States:
    """The saved states; handles the requests.

    Attributes:
        keeper: Saves and restores states.
        close: Ends the thread that reads and writes files.

    Args:
        keeper: Saves and restores states.
        host: The host of the server.
        limits: Limits in memory, and in the folder.
        folder: The folder of files; None if there is none.
        thread: Reads and writes files.
    """

    def __init__(self, keeper: Keeper, host: Host, limits: Limits, folder: Path | None, thread: FileThread) -> None:
        self.keeper = keeper
        self._host = host
        self._limits = limits
        self._thread = thread
        self._found = None if folder is None else StateFiles(folder, limits.max_states, limits.max_bytes)
        self._memory: dict[str, SavedState] = {}
        self.close: Callable[[], None] = thread.close

    def vector(self, name: str, file: bool) -> Generator[Wait, None, NDArray[np.float64]]:
        """Finds a state and returns its vector mjSTATE_INTEGRATION; yields what to wait for.

        Raises:
            RequestError: There is no such state, or this server could not restore it.
        """
        if file:
            files = self._files()
            state = yield from self._thread.run(lambda: files.read(check_name(name)))
        else:
            state = self._in_memory(check_name(name))
        try:
            self.keeper.check(state, keep_time=True)
        except RequestError as error:
            raise RequestError(f"state {name!r} cannot be used: {error}") from None
        return state.physics.vector

    def save(self, request: SaveState.Request, call: Call) -> Slow:
        """Handles a request to `~/save_state`."""
        name = check_name(request.name)
        # Before the state is taken, which costs more.
        files = self._files() if request.file else None
        if files is None:
            self._check_room(name, request.overwrite)
        state = self.keeper.save()
        size = state.size
        if files is not None:
            size = yield from self._thread.run(lambda: files.write(name, state, request.overwrite))
        else:
            self._check_room(name, request.overwrite, size)
            self._memory[name] = state
        message = f"state {name!r} was saved at t = {state.header.time_ns / 1e9:.6f} s (step {state.header.step})"
        if state.left_out:
            message += f"; not saved: {listing(state.left_out)}"
        snapshot = describe(name, request.file, state.header, size)
        return SaveState.Response(success=True, message=message, snapshot=snapshot)

    def restore(self, request: RestoreState.Request, call: Call) -> Slow:
        """Handles a request to `~/restore_state`."""
        name, episode = check_name(request.name), episode_in(call.parameters)
        if request.file:
            files = self._files()
            state = yield from self._thread.run(lambda: files.read(name))
        else:
            state = self._in_memory(name)
        try:
            problems = self.keeper.restore(state, request.strict, request.keep_time, episode)
        except RequestError as error:
            raise RequestError(f"state {name!r} was not restored: {error}") from None
        message = f"state {name!r} was restored; t = {self._host.time_ns / 1e9:.6f} s (step {self._host.step})"
        if problems:
            message += f"; not restored: {listing(problems)}"
        snapshot = describe(name, request.file, state.header, state.size)
        snapshot = snapshot.model_copy(update={"left_out": tuple(map(one_line, problems))})
        return RestoreState.Response(success=True, message=message, snapshot=snapshot)

    def list(self, request: ListStates.Request, call: Call) -> Slow:
        """Handles a request to `~/list_states`."""
        snapshots = [describe(name, False, state.header, state.size) for name, state in self._memory.items()]
        errors: list[str] = []
        if (files := self._found) is not None:
            found, errors = yield from self._thread.run(files.list)
            snapshots += [describe(name, True, header, size) for name, header, size in found]
        message = f"{len(snapshots)} saved states" if not errors else f"invalid files: {'; '.join(errors)}"
        return ListStates.Response(success=True, message=message, snapshots=tuple(snapshots))

    def delete(self, request: DeleteState.Request, call: Call) -> Slow:
        """Handles a request to `~/delete_state`."""
        name = check_name(request.name)
        if request.file:
            files = self._files()
            yield from self._thread.run(lambda: files.delete(name))
        else:
            self._in_memory(name)
            del self._memory[name]
        return DeleteState.Response(success=True, message=f"state {name!r} was deleted")

    def digest(self, request: GetStateDigest.Request, call: Call) -> GetStateDigest.Response:
        """Handles a request to `~/get_state_digest`."""
        host = self._host
        return GetStateDigest.Response(
            success=True,
            step=host.step,
            stamp=host.now(),
            epoch=host.epoch,
            model_digest=self.keeper.model_digest,
            digest=self.keeper.digest(),
        )

    def _files(self) -> StateFiles:
        if self._found is None:
            raise RequestError("no folder for files is set; set snapshots.folder in the configuration")
        return self._found

    def _in_memory(self, name: str) -> SavedState:
        if name not in self._memory:
            raise UnknownName("state", name, self._memory)
        return self._memory[name]

    def _check_room(self, name: str, overwrite: bool, size: int = 0) -> None:
        """Checks whether a state of some size [bytes] may be kept in memory."""
        limits, others = self._limits, [state for other, state in self._memory.items() if other != name]
        if name in self._memory and not overwrite:
            raise RequestError(f"state {name!r} already exists; set overwrite, or choose another name")
        if len(others) >= limits.max_states:
            raise RequestError(
                f"{len(others)} states are in memory, the maximum (snapshots.max_states); delete one (~/delete_state)"
            )
        total = size + sum(state.size for state in others)
        if total > limits.max_bytes:
            raise RequestError(
                f"the states in memory would take {total} bytes; the maximum is {limits.max_bytes} "
                "(snapshots.max_bytes); delete one (~/delete_state)"
            )
