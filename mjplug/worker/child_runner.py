"""Runs a work in the worker process, with its own model, state and Zenoh session."""

import logging
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

import mujoco
import zenoh

from mjplug.contracts.remote_samples import perform
from mjplug.contracts.work import Job, Work
from mjplug.physics import process, snapshot
from mjplug.wire.bytes_endpoints import RemoteBytesSpec
from mjplug.wire.dialect import KeyWriter
from mjplug.wire.origin import UNKNOWN_TIME
from mjplug.wire.publisher import RemotePublisherSpec
from mjplug.wire.session import SessionSettings, join
from mjplug.worker.states import SharedStates


@dataclass(frozen=True, slots=True)
class ChildSetup:
    """The setup of a worker process. Picklable.

    Attributes:
        work: The work.
        publishers: The publishers that the work uses.
        session: The server's session settings.
        endpoints: Endpoints of the server's network, preferred first.
    """

    work: Work
    publishers: tuple[RemotePublisherSpec | RemoteBytesSpec, ...]
    session: SessionSettings
    endpoints: tuple[str, ...]


class ChildRunner:
    """Opens a work, performs its jobs, closes it.

    Args:
        setup: The setup of the process.
        model: The compiled model in the format of `mj_saveModel`.
        states: Handle of the shared states.
    """

    def __init__(self, setup: ChildSetup, model: bytes, states: int | str) -> None:
        process.configure_mujoco()
        self._setup = setup
        self._model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": model})
        self._data = mujoco.MjData(self._model)
        self._slots = SharedStates.attach(states, snapshot.size(self._model)).slots
        self._session: zenoh.Session | None = None
        self._publishers: list[Any] = []
        self._writers: list[KeyWriter] = []
        self._waited: dict[KeyWriter, float] = {}
        self._matched = threading.Event()
        # Simulated time and epoch of the job, for the attachments of its messages.
        self._now = (UNKNOWN_TIME, 0)

    def open(self, logger: logging.Logger) -> str:
        """Connects to the server's network, declares the publishers and opens the work.

        Returns:
            The text that `Work.open` returned.

        Raises:
            UnavailableError: The work cannot run in this environment.
            WireError: The connection to the server's network failed.
        """
        setup = self._setup
        session = self._session = join(setup.session, setup.endpoints)
        publishers = self._publishers = [
            spec.open(session, self._matched.set, lambda: self._now) for spec in setup.publishers
        ]
        self._writers = [writer for publisher in publishers for writer in publisher.writers]
        return setup.work.open(self._model, publishers, logger)

    def perform(self, slot: int, job: Job, matched: Sequence[bool], lag: float) -> Any:
        """Performs a job with the state in a slot; returns the result of `Work.perform`, in a `Sampled` with samples.

        Args:
            slot: Index of the slot with the state.
            job: The job.
            matched: For each writer of the publishers, in order, whether it has a subscriber in the server's process.
            lag: Maximum time to wait until this process has matched the same subscribers [s].
        """
        self._wait_for_matches(matched, lag)
        self._now = (job.time_ns, job.epoch)
        snapshot.load(self._model, self._data, self._slots[slot])
        return perform(self._setup.work, self._data, job, self._publishers)

    def close(self) -> None:
        """Closes the work and the session."""
        try:
            self._setup.work.close()
        finally:
            if self._session is not None:
                # zenoh's stubs leave the return type open.
                self._session.close()  # type: ignore[no-untyped-call]

    def _wait_for_matches(self, matched: Sequence[bool], lag: float) -> None:
        """Waits until this process has matched the subscribers that the server has matched, so that they miss nothing.

        If a subscriber is never matched here, the full time is waited only once for each `lag`.
        """
        until = monotonic() + lag
        for writer, now in zip(self._writers, matched, strict=True):
            if now:
                writer.refresh_matched()
        unmatched = {writer for writer, now in zip(self._writers, matched, strict=True) if now and not writer.matched}
        while any(self._waited.get(writer, 0.0) < lag for writer in unmatched):
            if not self._matched.wait(max(0.0, until - monotonic())):
                break
            self._matched.clear()
            unmatched = {writer for writer in unmatched if not writer.matched}
        self._waited = {writer: max(lag, self._waited.get(writer, 0.0)) for writer in unmatched}
