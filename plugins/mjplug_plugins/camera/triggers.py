"""Images on request: an answer comes when the image has been published, or with the reason why it will not be."""

import math
from collections.abc import Callable, Collection, Mapping
from itertools import count
from time import monotonic

from mjplug.plugin import Event, Job, RequestError, Slow
from mjplug_plugins.camera.work import camera_of, trigger_task
from mjplug_schemas.std_srvs import Trigger


class Triggers:
    """The requests that wait for an image.

    Attributes:
        refusal: Why there will be no images at all; empty while there may be.

    Args:
        submit: Hands a task to the process that draws.
        timeout: How long a request may wait [s of wall time].
    """

    def __init__(self, submit: Callable[[str], None], timeout: float = math.inf) -> None:
        self.refusal = ""
        self._timeout = timeout
        self._submit = submit
        self._numbers = count(1)
        self._waiting: dict[str, _Shot] = {}

    def serve(self, camera: str) -> Slow:
        """Handles one request."""
        if self.refusal:
            raise RequestError(self.refusal)
        task, shot = trigger_task(camera, next(self._numbers)), _Shot()
        self._waiting[task] = shot
        try:
            self._submit(task)
            yield shot.ended
        finally:
            del self._waiting[task]
        if shot.failure:
            raise RequestError(shot.failure)
        return Trigger.Response(success=True, message=shot.message)

    def done(self, job: Job, heard: Mapping[str, Collection[str]]) -> None:
        """Answers those whose image is there; `heard` says of each camera what somebody listened to."""
        stamp = "{}.{:09}".format(*divmod(job.time_ns, 1_000_000_000))
        for task in job.tasks & self._waiting.keys():
            topics = ", ".join(heard[camera_of(task)])
            did = f"published {topics}" if topics else "drawn, but nobody listens"
            self._waiting[task].end(message=f"{did}; stamp {stamp}")

    def expire(self, why: Callable[[], str]) -> None:
        """Refuses those that have waited for too long; `why` says what takes so long."""
        now = monotonic()
        for shot in [shot for shot in self._waiting.values() if now - shot.began >= self._timeout]:
            shot.end(failure=f"no image within {self._timeout:g} s (trigger_timeout): {why()}")

    def lost(self, tasks: frozenset[str], reason: str) -> None:
        """Answers those whose image will not come."""
        for task in tasks & self._waiting.keys():
            self._waiting[task].end(failure=reason)


class _Shot:
    """How one request ended."""

    def __init__(self) -> None:
        self.ended = Event()
        self.began = monotonic()
        self.message = ""
        self.failure = ""

    def end(self, message: str = "", failure: str = "") -> None:
        self.message, self.failure = message, failure
        self.ended.set()
