"""What the camera process does: draws what somebody listens to, and publishes it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from logging import Logger
from typing import Any

import mujoco

from mjplug.plugin import Job, Publisher, Work
from mjplug_plugins.camera.parameters import Background, Quality
from mjplug_plugins.camera.picture import Depths, Picture, Topics
from mjplug_plugins.camera.renderer import Renderer
from mjplug_plugins.camera.view import View

_STREAM, _TRIGGER = "stream", "trigger"


def stream_task(camera: str) -> str:
    """Names the task of publishing what is listened to of a camera."""
    return f"{_STREAM} {camera}"


def trigger_task(camera: str, number: int) -> str:
    """Names the task of publishing an image that somebody asked for."""
    return f"{_TRIGGER} {number} {camera}"


def camera_of(task: str) -> str:
    """Returns the camera that a task is about."""
    kind, _, rest = task.partition(" ")
    return rest if kind == _STREAM else rest.partition(" ")[2]


@dataclass(frozen=True, slots=True)
class Look:
    """How everything is drawn; see CameraParameters.

    Attributes:
        quality: How much of the lighting is drawn.
        geom_groups: Groups of geoms that are drawn.
        site_groups: Groups of sites that are drawn.
        background: Depth where there is nothing.
        jpeg_quality: 1 to 100 [%].
    """

    quality: Quality = "fast"
    geom_groups: tuple[int, ...] = (0, 1, 2)
    site_groups: tuple[int, ...] = ()
    background: Background = "inf"
    jpeg_quality: int = 95


class CameraWork(Work):
    """Draws and publishes the tasks of a job; reports what somebody listened to.

    Its publishers are those of `Topics`, view after view.

    Args:
        views: What there is to draw.
        look: How.
    """

    def __init__(self, views: Iterable[View], look: Look) -> None:
        self._views = tuple(views)
        self._look = look
        self._renderer: Renderer | None = None
        self._makers: dict[str, Callable[[], Picture]] = {}
        self._pictures: dict[str, Picture] = {}

    def open(self, model: mujoco.MjModel, publishers: Sequence[Publisher[Any]], logger: Logger) -> str:
        """Makes the OpenGL context and the images; says what draws."""
        look = self._look
        size = max(view.width for view in self._views), max(view.height for view in self._views)
        renderer = self._renderer = Renderer(model, *size, look.quality, look.geom_groups, look.site_groups)
        remaining = iter(publishers)
        depths = Depths(look.background, renderer.far)
        # Images may be large and cameras many, so the memory for a camera is taken when it is first drawn.
        self._makers = {
            view.name: partial(Picture, view, Topics.of(view, remaining), model, depths, look.jpeg_quality)
            for view in self._views
        }
        self._logger = logger
        self._complained = False
        gl = renderer.gl
        return f"rendering with {gl.backend} on {gl.renderer}{' (in software)' if gl.in_software else ''}"

    def perform(self, data: mujoco.MjData, job: Job) -> dict[str, tuple[str, ...]]:
        """Publishes; returns, by camera, what somebody listened to."""
        if self._renderer is None:
            raise RuntimeError("the camera work is not open")
        self._renderer.gl.make_current()
        asked = {camera_of(task) for task in job.tasks if task.startswith(_TRIGGER)}
        due = asked | {camera_of(task) for task in job.tasks}
        report = {}
        for name, make in self._makers.items():
            if name in due:
                if name not in self._pictures:
                    self._pictures[name] = make()
                report[name] = self._pictures[name].publish(self._renderer, data, job.time_ns, name in asked)
        if self._renderer.truncated and not self._complained:
            self._complained = True
            self._logger.warning("there are more objects than can be drawn; some are missing in the images")
        return report

    def close(self) -> None:
        """Frees the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
