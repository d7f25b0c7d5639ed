"""The camera plugin: decides when each camera publishes; a worker process renders the images."""

from typing import Any

from mjplug.plugin import LATEST, Host, Job, Plugin, PluginError, Publisher, UnknownName, Worker
from mjplug.plugin.bundled import ros_tokens
from mjplug_plugins.camera.diagnostics import CameraDiagnostics
from mjplug_plugins.camera.gl import environments
from mjplug_plugins.camera.parameters import CameraParameters, ViewParameters
from mjplug_plugins.camera.schedule import Publishers, Schedule
from mjplug_plugins.camera.triggers import Triggers
from mjplug_plugins.camera.view import View, camera_names, has_resolution, intrinsics_of, size_of
from mjplug_plugins.camera.work import CameraWork, RenderOptions, stream_task
from mjplug_plugins.rate_monitor import slow_reason
from mjplug_schemas.sensor_msgs import CameraInfo, CompressedImage, Image
from mjplug_schemas.std_srvs import Trigger


class Camera(Plugin[CameraParameters]):
    """Publishes the model's cameras: colour as rgb8, metric depth as 32FC1, and `sensor_msgs/CameraInfo`.

    A worker process renders only the images whose topics have subscribers. All messages with the same stamp show the
    state at that time.
    """

    stateless = True

    _schedule: Schedule | None = None

    def init(self, host: Host, parameters: CameraParameters) -> None:
        """Creates the publishers and services, and starts the timers and the worker process."""
        self._host = host
        ids, configured = camera_names(host.model), parameters.__pydantic_extra__
        for name in configured:
            if name not in ids:
                raise UnknownName("camera", name, ids)
        chosen = {name: configured.get(name, ViewParameters()) for name in ids}
        chosen = {name: own for name, own in chosen.items() if own.policy != "disabled"}
        if not chosen:
            reason = "every camera is disabled" if ids else "the model has no camera"
            host.logger.warning("%s: nothing is published", reason)
            return
        views = _views(host, ids, chosen, parameters)
        self._triggers = Triggers(lambda task: self._worker.submit([task], answered=True), parameters.trigger_timeout)
        self._topics: dict[str, dict[str, Publisher[Any]]] = {}
        publishers = {view.name: self._create_interfaces(view, chosen[view.name]) for view in views}
        options = RenderOptions(
            parameters.quality,
            parameters.geom_groups,
            parameters.site_groups,
            parameters.background,
            parameters.jpeg_quality,
        )
        self._diagnostics = CameraDiagnostics(self._topics, host.logger)
        self._worker: Worker = host.create_worker(
            CameraWork(views, options),
            [publisher for own in publishers.values() for publisher in own],
            environments=environments(),
            sync=parameters.sync,
            priority=parameters.priority,
            job_timeout=parameters.job_timeout,
            on_ready=self._ready,
            on_done=self._done,
            on_lost=self._lost,
            sample_tasks={publisher: [stream_task(name)] for name, own in publishers.items() for publisher in own},
        )
        rates: dict[float, dict[str, Publishers]] = {}
        for name, own in publishers.items():
            if chosen[name].policy == "streaming":
                rates.setdefault(chosen[name].publish_rate or parameters.camera_publish_rate, {})[name] = own
        self._schedule = Schedule(host, self._stream)
        for rate, cameras in rates.items():
            self._schedule.add(rate, cameras)
        host.create_diagnostic("", lambda: self._diagnostics.diagnose(self._worker))
        host.create_wall_timer(1.0, self._check)

    def on_reset(self) -> None:
        """Discards the images that are due."""
        if self._schedule is not None:
            self._schedule.clear()

    def _create_interfaces(self, view: View, settings: ViewParameters) -> Publishers:
        """Creates the publishers and the service of a camera; returns the publishers in the order of `CameraWork`."""
        host, name, token = self._host, view.name, view.token
        image, depth = settings.image_topic or f"{token}/color", settings.depth_topic or f"{token}/depth"
        topics: list[tuple[type[Image | CameraInfo | CompressedImage], str]] = [
            (Image, image),
            (Image, depth),
            (CameraInfo, settings.info_topic or f"{token}/camera_info"),
            (CompressedImage, f"{image}/compressed"),
            (CompressedImage, f"{depth}/compressedDepth"),
        ]
        if settings.segmentation != "none":
            topics.append((Image, f"{token}/segmentation"))
        try:
            publishers: Publishers = [host.create_publisher(kind, topic, LATEST) for kind, topic in topics]
            self._topics[name] = {
                host.full_name(topic): own for (_, topic), own in zip(topics, publishers, strict=True)
            }
            if settings.policy == "polled":
                service = settings.trigger_service_name or f"{token}/trigger"
                host.create_service(Trigger, service, lambda request, call: self._triggers.serve(name))
        except PluginError as error:
            raise PluginError(
                f"camera {name!r}: {error}; set other topics under its name, or policy: disabled"
            ) from error
        return publishers

    def _stream(self, cameras: set[str]) -> None:
        if not self._triggers.refusal:
            self._diagnostics.rates.count_requested(cameras)
            self._worker.submit(map(stream_task, cameras))

    def _check(self) -> None:
        self._diagnostics.check(self._worker)
        self._triggers.expire(lambda: slow_reason(self._worker))

    def _ready(self, report: str) -> None:
        first, self._diagnostics.renderer = not self._diagnostics.renderer, report
        if first and "(in software)" in report:
            self._host.logger.warning(
                "%s: no GPU or no driver was found; reduce the image size or the rate to use less processor time",
                report,
            )
        elif first:
            self._host.logger.info("%s", report)

    def _done(self, job: Job, matched_topics: dict[str, tuple[str, ...]]) -> None:
        self._diagnostics.rates.count_published(camera for camera, topics in matched_topics.items() if topics)
        self._triggers.done(job, matched_topics)

    def _lost(self, tasks: frozenset[str], reason: str) -> None:
        if self._worker.status.state == "unavailable" and not self._triggers.refusal:
            self._triggers.refusal = f"cameras are unavailable: {reason}"
        self._triggers.lost(tasks, reason)


def _views(
    host: Host, ids: dict[str, int], chosen: dict[str, ViewParameters], parameters: CameraParameters
) -> list[View]:
    """Returns the view of each camera."""
    model = host.model
    tokens = ros_tokens(ids, "camera", host.logger)
    views: list[View] = []
    default_sized: list[str] = []
    for name, settings in chosen.items():
        camera = ids[name]
        own, usual = (settings.width, settings.height), (parameters.width, parameters.height)
        width, height = size_of(model, camera, own, usual)
        if not has_resolution(model, camera) and None in (own[0] or usual[0], own[1] or usual[1]):
            default_sized.append(f"{name} {width}x{height}")
        frame = f"{name}_frame" if settings.frame_name is None else settings.frame_name
        frame = host.frame_id(frame)
        intrinsics = intrinsics_of(model, camera, width, height)
        views.append(View(name, tokens[name], camera, width, height, frame, intrinsics, settings.segmentation))
    if default_sized:
        host.logger.info(
            "these cameras have no resolution, so they use the size of the model's offscreen buffer: %s",
            ", ".join(default_sized),
        )
    return views
