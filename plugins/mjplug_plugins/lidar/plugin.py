"""The lidar plugin: finds the lidars, submits scans at their rates and reports diagnostics."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

from mjplug.plugin import (
    LATEST,
    Diagnosis,
    Host,
    Job,
    Level,
    Plugin,
    PluginError,
    Publisher,
    UnknownName,
    worker_diagnosis,
)
from mjplug.plugin.bundled import lidar_sensors
from mjplug_plugins.lidar.parameters import LidarParameters, PluginParameters
from mjplug_plugins.lidar.settings import REQUIRED, Settings, settings_of
from mjplug_plugins.lidar.work import LidarWork
from mjplug_plugins.rate_monitor import RateMonitor
from mjplug_schemas.sensor_msgs import LaserScan, PointCloud2

Scans = LaserScan | PointCloud2


class Lidar(Plugin[PluginParameters]):
    """Publishes each lidar as `sensor_msgs/LaserScan`, or as `sensor_msgs/PointCloud2` if it has several rows.

    The lidars are the `mujoco.plugin.lidar` sensors of the model and those that the parameters put at a site. A worker
    process casts the rays, and only for lidars whose topic has subscribers. A message shows the state at its stamp.
    """

    stateless = True

    def init(self, host: Host, parameters: PluginParameters) -> None:
        """Finds the lidars, creates the worker process and starts the timers."""
        self._durations: dict[str, float] = {}
        self._lost_reason = ""
        self._host = host
        lidars = _lidars(host, parameters.__pydantic_extra__)
        if not lidars:
            host.logger.warning(
                "the model has no mujoco.plugin.lidar sensor and no lidar is configured: nothing is published"
            )
            return
        _warn_of_shared_topics(host, lidars)
        self._publishers = {lidar.name: _publisher(host, lidar) for lidar in lidars}
        self._worker = host.create_worker(
            LidarWork(lidars, parameters.threads),
            list(self._publishers.values()),
            sync=parameters.sync,
            priority=parameters.priority,
            job_timeout=parameters.job_timeout,
            on_done=self._scan_done,
            on_lost=self._scan_lost,
            sample_tasks={publisher: [name] for name, publisher in self._publishers.items()},
        )
        # Lidars of the same rate share a timer, so that their scans show the same state.
        for rate in sorted({lidar.update_rate for lidar in lidars}):
            self._start_timer(rate, [lidar.name for lidar in lidars if lidar.update_rate == rate])
        topics = {lidar.name: {host.full_name(lidar.topic): self._publishers[lidar.name]} for lidar in lidars}
        self._rates = RateMonitor("scans", topics, host.logger)
        host.create_diagnostic("", self._diagnose)
        host.create_wall_timer(1.0, lambda: self._rates.check(self._worker, self._worker.status.dropped))

    def _start_timer(self, rate: float, names: list[str]) -> None:
        def submit() -> None:
            due = [name for name in names if self._publishers[name].matched]
            self._rates.count_requested(due)
            self._worker.submit(due)

        period = 1.0 / rate if rate else float(self._host.model.opt.timestep)
        self._host.create_timer(period, submit, while_matched=[self._publishers[name] for name in names])

    def _scan_done(self, job: Job, durations: Mapping[str, float]) -> None:
        self._durations.update(durations)
        self._rates.count_published(durations)
        self._lost_reason = ""

    def _scan_lost(self, names: frozenset[str], reason: str) -> None:
        if reason != self._lost_reason:
            self._host.logger.warning("no scan of %s: %s", ", ".join(sorted(names)) or "any lidar", reason)
        self._lost_reason = reason

    def _diagnose(self) -> Diagnosis:
        diagnosis = worker_diagnosis(self._worker.status)
        times = {
            f"last scan of {name} [ms]": f"{1e3 * duration:.2f}" for name, duration in sorted(self._durations.items())
        }
        values = {**diagnosis.values, **times, **self._rates.values()}
        warning = self._rates.warning(self._worker)
        if diagnosis.level == Level.OK and warning:
            return Diagnosis(Level.WARN, warning, values)
        return Diagnosis(diagnosis.level, diagnosis.message, values)


def _lidars(host: Host, configured: Mapping[str, LidarParameters]) -> list[Settings]:
    """Returns the lidars of the model in model order, then the lidars that are only configured."""
    sensors = lidar_sensors(host.model)
    seed = int(host.random.integers(2**63))
    lidars: list[Settings] = []
    for name in dict.fromkeys(chain(sensors, configured)):
        given = configured.get(name, LidarParameters())
        if name not in sensors and given.site is None:
            unknown = UnknownName("lidar", name, sensors)
            missing = ", ".join(key for key in REQUIRED if getattr(given, key) is None)
            raise PluginError(
                f"{unknown}; for a lidar that is not in the model, these parameters are missing: {missing}"
            )
        # The seed contains the name, so that adding a lidar does not change the noise of the others.
        noise = (seed, *name.encode())
        settings = settings_of(host.model, name, sensors.get(name), given, noise)
        lidars.append(replace(settings, frame_name=host.frame_id(settings.frame_name)))
    return lidars


def _warn_of_shared_topics(host: Host, lidars: list[Settings]) -> None:
    names = defaultdict(list)
    for lidar in lidars:
        names[host.full_name(lidar.topic)].append(lidar.name)
    for topic, sharing in names.items():
        if len(sharing) > 1:
            host.logger.warning("lidars %s publish on the same topic, %s", ", ".join(sharing), topic)


def _publisher(host: Host, lidar: Settings) -> Publisher[Scans]:
    kind = PointCloud2 if lidar.rows > 1 else LaserScan
    return host.create_publisher(kind, lidar.topic, LATEST)
