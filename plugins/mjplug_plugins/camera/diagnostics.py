"""Status of the cameras for `/diagnostics`."""

from collections.abc import Mapping
from logging import Logger
from typing import Any

from mjplug.plugin import Diagnosis, Level, Publisher, Worker, worker_diagnosis
from mjplug_plugins.camera.work import stream_task
from mjplug_plugins.rate_monitor import RateMonitor


class CameraDiagnostics:
    """Counts requested, published and dropped images.

    Attributes:
        renderer: OpenGL backend and renderer; empty until the worker process has started.
        rates: Requested and published images of each camera.

    Args:
        topics: For each camera, its publishers by the full names of their topics.
        logger: The logger of the plugin instance.
    """

    def __init__(self, topics: Mapping[str, Mapping[str, Publisher[Any]]], logger: Logger) -> None:
        self.renderer = ""
        self.rates = RateMonitor("images", topics, logger)
        self._cameras = tuple(topics)
        self._dropped = 0

    def check(self, worker: Worker) -> None:
        """Compares the rates; call it about once per second of wall time."""
        dropped = worker.status.dropped
        self.rates.check(worker, {camera: dropped.get(stream_task(camera), 0) for camera in self._cameras})

    def diagnose(self, worker: Worker) -> Diagnosis:
        """Returns the status of the cameras and of the worker process."""
        dropped = sum(worker.status.dropped.values())
        new, self._dropped = dropped - self._dropped, dropped
        status = worker_diagnosis(worker.status)
        values = {**status.values, "renderer": self.renderer, **self.rates.values()}
        if status.level == Level.OK and (warning := self.rates.warning(worker)):
            return Diagnosis(Level.WARN, warning, values)
        if status.level == Level.OK and new > 0:
            warning = f"rendering is slower than requested; {new} images were dropped since the last status"
            return Diagnosis(Level.WARN, warning, values)
        return Diagnosis(status.level, status.message, values)
