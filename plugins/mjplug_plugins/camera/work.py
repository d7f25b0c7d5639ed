"""The work of the camera worker process: renders and publishes the images whose topics have subscribers."""

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
    """Returns the task that publishes the topics of a camera that have subscribers."""
    return f"{_STREAM} {camera}"


def trigger_task(camera: str, number: int) -> str:
    """Returns the task that renders and publishes an image for one trigger request."""
    return f"{_TRIGGER} {number} {camera}"


def camera_of(task: str) -> str:
    """Returns the camera of a task."""
    kind, _, rest = task.partition(" ")
    return rest if kind == _STREAM else rest.partition(" ")[2]


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """Options of rendering; see CameraParameters.

    Attributes:
        quality: `fast` or `full`.
        geom_groups: Geom groups that are rendered.
        site_groups: Site groups that are rendered.
        background: Kind of depth value for the background.
        jpeg_quality: JPEG quality, 1 to 100 [%].
    """

    quality: Quality = "fast"
    geom_groups: tuple[int, ...] = (0, 1, 2)
    site_groups: tuple[int, ...] = ()
    background: Background = "inf"
    jpeg_quality: int = 95


class CameraWork(Work):
    """Renders and publishes the cameras of a job; reports which topics had subscribers.

    Its publishers are those of `Topics` for each view in turn.

    Args:
        views: The views of all cameras.
        options: Options of rendering.
    """

    def __init__(self, views: Iterable[View], options: RenderOptions) -> None:
        self._views = tuple(views)
        self._options = options
        self._renderer: Renderer | None = None
        self._factories: dict[str, Callable[[], Picture]] = {}
        self._pictures: dict[str, Picture] = {}

    def open(self, model: mujoco.MjModel, publishers: Sequence[Publisher[Any]], logger: Logger) -> str:
        """Creates the OpenGL context and the messages; returns the name of the renderer."""
        options = self._options
        size = max(view.width for view in self._views), max(view.height for view in self._views)
        renderer = self._renderer = Renderer(model, *size, options.quality, options.geom_groups, options.site_groups)
        remaining = iter(publishers)
        depths = Depths(options.background, renderer.far)
        # Images may be large and cameras many, so the memory of a camera is allocated when it is first rendered.
        self._factories = {
            view.name: partial(Picture, view, Topics.of(view, remaining), model, depths, options.jpeg_quality)
            for view in self._views
        }
        self._logger = logger
        self._warned = False
        gl = renderer.gl
        return f"rendering with {gl.backend} on {gl.renderer}{' (in software)' if gl.in_software else ''}"

    def perform(self, data: mujoco.MjData, job: Job) -> dict[str, tuple[str, ...]]:
        """Renders and publishes; returns, by camera, the topics that had subscribers."""
        if self._renderer is None:
            raise RuntimeError("the camera work is not open")
        self._renderer.gl.make_current()
        triggered = {camera_of(task) for task in job.tasks if task.startswith(_TRIGGER)}
        due = triggered | {camera_of(task) for task in job.tasks}
        report = {}
        for name, make in self._factories.items():
            if name in due:
                if name not in self._pictures:
                    self._pictures[name] = make()
                report[name] = self._pictures[name].publish(self._renderer, data, job.time_ns, name in triggered)
        if self._renderer.truncated and not self._warned:
            self._warned = True
            self._logger.warning("the scene contains too many objects to render; some are missing in the images")
        return report

    def close(self) -> None:
        """Frees the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
