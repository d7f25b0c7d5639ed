"""Images on request: a response is sent after the image was published, or with the reason why it was not."""

import math
from collections.abc import Callable, Collection, Mapping
from itertools import count
from time import monotonic

from mjplug.plugin import Event, Job, RequestError, Slow
from mjplug_plugins.camera.work import camera_of, trigger_task
from mjplug_schemas.std_srvs import Trigger


class Triggers:
    """The trigger requests that wait for an image.

    Attributes:
        refusal: Reason why all requests fail; empty while images can be rendered.

    Args:
        submit: Submits a task to the worker process.
        timeout: Longest wall time that a request waits [s].
    """

    def __init__(self, submit: Callable[[str], None], timeout: float = math.inf) -> None:
        self.refusal = ""
        self._timeout = timeout
        self._submit = submit
        self._numbers = count(1)
        self._waiting: dict[str, _PendingRequest] = {}

    def serve(self, camera: str) -> Slow:
        """Handles one request for an image of a camera."""
        if self.refusal:
            raise RequestError(self.refusal)
        task, pending = trigger_task(camera, next(self._numbers)), _PendingRequest()
        self._waiting[task] = pending
        try:
            self._submit(task)
            yield pending.ended
        finally:
            del self._waiting[task]
        if pending.failure:
            raise RequestError(pending.failure)
        return Trigger.Response(success=True, message=pending.message)

    def done(self, job: Job, matched_topics: Mapping[str, Collection[str]]) -> None:
        """Answers the requests whose images are published; `matched_topics` are the topics of each camera."""
        stamp = "{}.{:09}".format(*divmod(job.time_ns, 1_000_000_000))
        for task in job.tasks & self._waiting.keys():
            topics = ", ".join(matched_topics[camera_of(task)])
            result = f"published {topics}" if topics else "rendered, but no topic has subscribers"
            self._waiting[task].end(message=f"{result}; stamp {stamp}")

    def expire(self, reason: Callable[[], str]) -> None:
        """Fails the requests that have waited longer than the timeout; `reason` returns why rendering is slow."""
        now = monotonic()
        for pending in [pending for pending in self._waiting.values() if now - pending.began >= self._timeout]:
            pending.end(failure=f"no image within {self._timeout:g} s (trigger_timeout): {reason()}")

    def lost(self, tasks: frozenset[str], reason: str) -> None:
        """Fails the requests whose images were not rendered."""
        for task in tasks & self._waiting.keys():
            self._waiting[task].end(failure=reason)


class _PendingRequest:
    """One request and its result."""

    def __init__(self) -> None:
        self.ended = Event()
        self.began = monotonic()
        self.message = ""
        self.failure = ""

    def end(self, message: str = "", failure: str = "") -> None:
        self.message, self.failure = message, failure
        self.ended.set()
