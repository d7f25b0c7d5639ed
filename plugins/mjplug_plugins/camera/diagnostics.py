"""How the cameras fare, for `/diagnostics`."""

from collections.abc import Mapping
from logging import Logger
from typing import Any

from mjplug.plugin import Diagnosis, Level, Publisher, Worker, worker_diagnosis
from mjplug_plugins.camera.work import stream_task
from mjplug_plugins.pace import Pace


class CameraDiagnostics:
    """Counts images.

    Attributes:
        renderer: What draws; empty until that is known.
        pace: Counts what is due and what was drawn.

    Args:
        topics: For each camera, its publishers by the full names of their topics.
        logger: The plugin's.
    """

    def __init__(self, topics: Mapping[str, Mapping[str, Publisher[Any]]], logger: Logger) -> None:
        self.renderer = ""
        self.pace = Pace("images", topics, logger)
        self._cameras = tuple(topics)
        self._dropped = 0

    def look(self, worker: Worker) -> None:
        """Compares the rates; to be called about once a second of wall time."""
        dropped = worker.status.dropped
        self.pace.look(worker, {camera: dropped.get(stream_task(camera), 0) for camera in self._cameras})

    def diagnose(self, worker: Worker) -> Diagnosis:
        """Returns the state of things."""
        dropped = sum(worker.status.dropped.values())
        newly, self._dropped = dropped - self._dropped, dropped
        said = worker_diagnosis(worker.status)
        values = {**said.values, "renderer": self.renderer, **self.pace.values()}
        if said.level == Level.OK and (slow := self.pace.slow(worker)):
            return Diagnosis(Level.WARN, slow, values)
        if said.level == Level.OK and newly > 0:
            slow = f"drawing is slower than asked for; {newly} images were dropped since the last status"
            return Diagnosis(Level.WARN, slow, values)
        return Diagnosis(said.level, said.message, values)
