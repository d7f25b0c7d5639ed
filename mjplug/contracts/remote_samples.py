"""Samples of topics that a worker process publishes: the message for exactly one state, brought back to the server.

The server adds a task for each wanted publisher to a job. The worker process removes these tasks before the work sees
the job, and returns the messages of these publishers together with the report of the work.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.work import Job, Work, Worker
from mjplug.errors import RequestError
from mjplug.physics.scheduler import Event
from mjplug_schemas.message import Message

_PREFIX = "\0sample "
"""Prefix of the tasks for publishers; plugins do not use this character."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """The result of a job with samples.

    Attributes:
        report: The result of `Work.perform`.
        samples: The newest message of each wanted publisher in CDR, by the index of the publisher.
    """

    report: Any
    samples: dict[int, bytes]


def _split(tasks: Iterable[str]) -> tuple[frozenset[str], list[int]]:
    """Returns the tasks of the plugin, and the indices of the wanted publishers."""
    names = frozenset(tasks)
    wanted = {name for name in names if name.startswith(_PREFIX)}
    return names - wanted, sorted(int(name.removeprefix(_PREFIX)) for name in wanted)


def perform(work: Work, data: mujoco.MjData, job: Job, publishers: Sequence[Any]) -> Any:
    """Performs a job in the worker process.

    Args:
        work: The work.
        data: The state.
        job: The job; its tasks for publishers are removed.
        publishers: The publishers of the work.

    Returns:
        The result of `Work.perform`; in a `Sampled` if samples are wanted.
    """
    plain, wanted = _split(job.tasks)
    if not wanted:
        return work.perform(data, job)
    samples: dict[int, bytes] = {}
    for index in wanted:
        publishers[index].tap = _keeper(samples, index)
    try:
        report = work.perform(data, replace(job, tasks=plain))
    finally:
        for index in wanted:
            publishers[index].tap = None
    return Sampled(report, samples)


def _keeper(samples: dict[int, bytes], index: int) -> Callable[[Message | CdrFrame], None]:
    def keep(message: Message | CdrFrame) -> None:
        samples[index] = message.payload() if isinstance(message, CdrFrame) else message.to_cdr()

    return keep


class RemoteSamples:
    """Requests samples of the publishers of one worker. Physics thread only.

    Attributes:
        sync: Whether the loop takes no step until a job is done. Only then does a sample describe the present state.
        worker: The worker; the host sets it.

    Args:
        sync: As above.
        tasks: The tasks that publish the topic of each publisher, in the order of the publishers; empty if unknown.
        on_done: The plugin's function for completed jobs.
        on_lost: The plugin's function for lost tasks.
    """

    worker: Worker

    def __init__(
        self,
        sync: bool,
        tasks: Sequence[Iterable[str]],
        on_done: Callable[[Job, Any], None],
        on_lost: Callable[[frozenset[str], str], None],
    ) -> None:
        self.sync = sync
        self._tasks = [tuple(names) for names in tasks]
        self._on_done, self._on_lost = on_done, on_lost
        self._waiting: list[_Wanted] = []

    def check(self, index: int) -> None:
        """Checks whether there are samples of a publisher.

        Raises:
            RequestError: There are none; the text says why.
        """
        if not self.sync:
            raise RequestError("a worker process publishes it, and physics does not wait for it; set its plugin's sync")
        if not self._tasks[index]:
            raise RequestError("a worker process publishes it, and its plugin provides no samples")
        if self.worker.status.state == "unavailable":
            raise RequestError(f"its worker process is unavailable: {self.worker.status.reason}")

    def request(self, indices: Iterable[int]) -> "_Wanted":
        """Requests the messages of some publishers for the present state."""
        wanted = _Wanted(frozenset(indices))
        self._waiting.append(wanted)
        tasks = {task for index in wanted.indices for task in self._tasks[index]}
        self.worker.submit(tasks | {f"{_PREFIX}{index}" for index in wanted.indices})
        return wanted

    def done(self, job: Job, report: Any) -> None:
        """Handles a completed job."""
        if isinstance(report, Sampled):
            for wanted in [wanted for wanted in self._waiting if wanted.indices <= report.samples.keys()]:
                self._waiting.remove(wanted)
                wanted.samples = report.samples
                wanted.ended.set()
            plain, indices = _split(job.tasks)
            self._end(indices, "the worker process published no message")
            job, report = replace(job, tasks=plain), report.report
        self._on_done(job, report)

    def lost(self, tasks: frozenset[str], reason: str) -> None:
        """Handles tasks that will not be performed."""
        plain, indices = _split(tasks)
        self._end(indices, reason)
        if plain or not indices:
            self._on_lost(plain, reason)

    def end(self, reason: str) -> None:
        """Ends all requests for samples, because the worker ends."""
        for wanted in self._waiting:
            wanted.failure = reason
            wanted.ended.set()
        self._waiting.clear()

    def _end(self, indices: Iterable[int], reason: str) -> None:
        for wanted in [wanted for wanted in self._waiting if not wanted.indices.isdisjoint(indices)]:
            self._waiting.remove(wanted)
            wanted.failure = reason
            wanted.ended.set()


class _Wanted:
    """The samples that one request waits for.

    Attributes:
        indices: Indices of the publishers.
        ended: Set when there are samples or a failure.
        samples: The messages in CDR.
        failure: Why there are none; empty if there are.
    """

    def __init__(self, indices: frozenset[int]) -> None:
        self.indices = indices
        self.ended = Event()
        self.samples: Mapping[int, bytes] = {}
        self.failure = ""
