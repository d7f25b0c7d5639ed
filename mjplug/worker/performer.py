"""A work in its process: with a model and a state of its own, and publishers on a Zenoh session of its own."""

import logging
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

import mujoco
import zenoh

from mjplug.core import process, snapshot
from mjplug.wire.dialect import Outlet
from mjplug.wire.publisher import PublisherLease
from mjplug.wire.session import SessionSettings, join
from mjplug.work import Job, Work
from mjplug.worker.states import SharedStates


@dataclass(frozen=True, slots=True)
class Assignment:
    """What a process is to do; it pickles.

    Attributes:
        work: The work.
        publishers: What it publishes to.
        session: The server's settings of the network.
        endpoints: Where the server's network can be joined.
    """

    work: Work
    publishers: tuple[PublisherLease, ...]
    session: SessionSettings
    endpoints: tuple[str, ...]


class Performer:
    """Opens a work, performs its jobs, closes it.

    Args:
        assignment: What to do.
        model: The compiled model, as `mj_saveModel` writes it.
        states: Where the states are.
    """

    def __init__(self, assignment: Assignment, model: bytes, states: int | str) -> None:
        process.tame_mujoco()
        self._assignment = assignment
        self._model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": model})
        self._data = mujoco.MjData(self._model)
        self._slots = SharedStates.attach(states, snapshot.size(self._model)).slots
        self._session: zenoh.Session | None = None
        self._outlets: list[Outlet] = []
        self._given_up: dict[Outlet, float] = {}
        self._appeared = threading.Event()

    def open(self, logger: logging.Logger) -> str:
        """Joins the network, declares the publishers and opens the work; returns what the work says.

        Raises:
            UnavailableError: The work cannot be done in this environment.
            WireError: The server's network lets nobody in.
        """
        assignment = self._assignment
        session = self._session = join(assignment.session, assignment.endpoints)
        publishers = [lease.open(session, self._appeared.set) for lease in assignment.publishers]
        self._outlets = [outlet for publisher in publishers for outlet in publisher.outlets]
        return assignment.work.open(self._model, publishers, logger)

    def perform(
        self, slot: int, time_ns: int, epoch: int, tasks: Iterable[str], wanted: Sequence[bool], lag: float
    ) -> Any:
        """Performs a job on the state in a slot; returns what the work returns.

        Args:
            slot: Where the state is.
            time_ns: The job's time [ns].
            epoch: The job's epoch.
            tasks: What to make.
            wanted: Which outlets, of all publishers in their order, have listeners by what the server knows.
            lag: How much later than the server this process may hear of a listener [s].
        """
        self._hear_of(wanted, lag)
        snapshot.load(self._model, self._data, self._slots[slot])
        return self._assignment.work.perform(self._data, Job(time_ns, epoch, frozenset(tasks)))

    def close(self) -> None:
        """Closes the work and leaves the network."""
        try:
            self._assignment.work.close()
        finally:
            if self._session is not None:
                # zenoh's stubs leave the return type open.
                self._session.close()  # type: ignore[no-untyped-call]

    def _hear_of(self, wanted: Sequence[bool], lag: float) -> None:
        """Waits until a listener that the server has just heard of is known here too, so that it misses nothing.

        Where the network keeps a listener from this process for good, it waits once for each `lag`.
        """
        until = monotonic() + lag
        for outlet, now in zip(self._outlets, wanted, strict=True):
            if now:
                outlet.look()
        unheard = {outlet for outlet, now in zip(self._outlets, wanted, strict=True) if now and not outlet.matched}
        while any(self._given_up.get(outlet, 0.0) < lag for outlet in unheard):
            if not self._appeared.wait(max(0.0, until - monotonic())):
                break
            self._appeared.clear()
            unheard = {outlet for outlet in unheard if not outlet.matched}
        self._given_up = {outlet: max(lag, self._given_up.get(outlet, 0.0)) for outlet in unheard}
