"""A work in its process: with a model and a state of its own, and publishers on a Zenoh session of its own."""

import logging
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

import mujoco
import zenoh

from mjplug.contracts.work import Job, Work
from mjplug.physics import process, snapshot
from mjplug.wire.dialect import KeyWriter
from mjplug.wire.publisher import RemotePublisherSpec
from mjplug.wire.session import SessionSettings, join
from mjplug.worker.states import SharedStates


@dataclass(frozen=True, slots=True)
class ChildSetup:
    """What a process is to do; it pickles.

    Attributes:
        work: The work.
        publishers: What it publishes to.
        session: The server's settings of the network.
        endpoints: Where the server's network can be joined.
    """

    work: Work
    publishers: tuple[RemotePublisherSpec, ...]
    session: SessionSettings
    endpoints: tuple[str, ...]


class ChildRunner:
    """Opens a work, performs its jobs, closes it.

    Args:
        setup: What to do.
        model: The compiled model, as `mj_saveModel` writes it.
        states: Where the states are.
    """

    def __init__(self, setup: ChildSetup, model: bytes, states: int | str) -> None:
        process.configure_mujoco()
        self._setup = setup
        self._model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": model})
        self._data = mujoco.MjData(self._model)
        self._slots = SharedStates.attach(states, snapshot.size(self._model)).slots
        self._session: zenoh.Session | None = None
        self._writers: list[KeyWriter] = []
        self._given_up: dict[KeyWriter, float] = {}
        self._appeared = threading.Event()

    def open(self, logger: logging.Logger) -> str:
        """Joins the network, declares the publishers and opens the work; returns what the work says.

        Raises:
            UnavailableError: The work cannot be done in this environment.
            WireError: The server's network lets nobody in.
        """
        setup = self._setup
        session = self._session = join(setup.session, setup.endpoints)
        publishers = [spec.open(session, self._appeared.set) for spec in setup.publishers]
        self._writers = [writer for publisher in publishers for writer in publisher.writers]
        return setup.work.open(self._model, publishers, logger)

    def perform(
        self, slot: int, time_ns: int, epoch: int, tasks: Iterable[str], wanted: Sequence[bool], lag: float
    ) -> Any:
        """Performs a job on the state in a slot; returns what the work returns.

        Args:
            slot: Where the state is.
            time_ns: The job's time [ns].
            epoch: The job's epoch.
            tasks: What to make.
            wanted: Which writers, of all publishers in their order, have listeners by what the server knows.
            lag: How much later than the server this process may hear of a listener [s].
        """
        self._wait_for_matches(wanted, lag)
        snapshot.load(self._model, self._data, self._slots[slot])
        return self._setup.work.perform(self._data, Job(time_ns, epoch, frozenset(tasks)))

    def close(self) -> None:
        """Closes the work and leaves the network."""
        try:
            self._setup.work.close()
        finally:
            if self._session is not None:
                # zenoh's stubs leave the return type open.
                self._session.close()  # type: ignore[no-untyped-call]

    def _wait_for_matches(self, wanted: Sequence[bool], lag: float) -> None:
        """Waits until a listener that the server has just heard of is known here too, so that it misses nothing.

        Where the network keeps a listener from this process for good, it waits once for each `lag`.
        """
        until = monotonic() + lag
        for writer, now in zip(self._writers, wanted, strict=True):
            if now:
                writer.look()
        unmatched = {writer for writer, now in zip(self._writers, wanted, strict=True) if now and not writer.matched}
        while any(self._given_up.get(writer, 0.0) < lag for writer in unmatched):
            if not self._appeared.wait(max(0.0, until - monotonic())):
                break
            self._appeared.clear()
            unmatched = {writer for writer in unmatched if not writer.matched}
        self._given_up = {writer: max(lag, self._given_up.get(writer, 0.0)) for writer in unmatched}
