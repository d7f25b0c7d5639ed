"""How the cameras fare, for `/diagnostics`."""

from collections.abc import Collection, Iterable, Mapping
from time import monotonic

from mjplug.plugin import Diagnosis, Level, Worker, worker_diagnosis


class Fitness:
    """Counts images.

    Attributes:
        renderer: What draws; empty until that is known.

    Args:
        cameras: Names.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self.renderer = ""
        self._images = dict.fromkeys(cameras, 0)
        self._dropped = 0
        self._since = monotonic()

    def count(self, heard: Mapping[str, Collection[str]]) -> None:
        """Takes a report of the process: the cameras that were due, and what somebody listened to."""
        for camera, topics in heard.items():
            self._images[camera] += bool(topics)

    def diagnose(self, worker: Worker) -> Diagnosis:
        """Returns the state of things; rates are since the last call."""
        now = monotonic()
        elapsed, self._since = max(now - self._since, 1e-9), now
        dropped = sum(worker.health.dropped.values())
        newly, self._dropped = dropped - self._dropped, dropped
        said = worker_diagnosis(worker.health)
        values = {**said.values, "renderer": self.renderer}
        for camera, images in self._images.items():
            values[f"images/s of {camera}"] = round(images / elapsed, 1)
            self._images[camera] = 0
        if said.level == Level.OK and newly > 0:
            slow = f"drawing is slower than asked for; {newly} images were dropped since the last status"
            return Diagnosis(Level.WARN, slow, values)
        return Diagnosis(said.level, said.message, values)
