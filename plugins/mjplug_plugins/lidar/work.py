"""The work of the lidar worker process: casts the rays of the due lidars and publishes the scans."""

from collections.abc import Mapping, Sequence
from logging import Logger
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from mjplug.plugin import Job, Publisher, Work
from mjplug_plugins.lidar.casting import Caster
from mjplug_plugins.lidar.messages import frame_of
from mjplug_plugins.lidar.pattern import Rays
from mjplug_plugins.lidar.settings import Settings

_RANGE_MARGIN = 1e-9
"""Rays are cast this much farther than max_range [m]; the distances are compared exactly afterwards."""


class LidarWork(Work):
    """Casts and publishes lidar scans; a task is the name of a lidar.

    Args:
        lidars: Settings of the lidars, in the order of the publishers.
        threads: Number of threads that cast rays.
    """

    def __init__(self, lidars: Sequence[Settings], threads: int = 1) -> None:
        self._settings = tuple(lidars)
        self._threads = threads
        self._caster: Caster | None = None
        self._lidars: dict[str, _Lidar] = {}

    def open(self, model: mujoco.MjModel, publishers: Sequence[Publisher[Any]], logger: Logger) -> str:
        """Prepares the rays and the messages."""
        self._caster = Caster(model, self._threads)
        self._lidars = {
            settings.name: _Lidar(settings, self._caster, publisher)
            for settings, publisher in zip(self._settings, publishers, strict=True)
        }
        return ""

    def perform(self, data: mujoco.MjData, job: Job) -> Mapping[str, float]:
        """Casts and publishes the scans; returns the duration of each [s]."""
        assert self._caster is not None
        self._caster.pose(data)
        durations: dict[str, float] = {}
        # The order of a set varies; sorted, two lidars that share a topic are always published in the same order.
        for name in sorted(job.tasks):
            began = perf_counter()
            self._lidars[name].publish(data, job)
            durations[name] = perf_counter() - began
        return durations

    def close(self) -> None:
        """Stops the threads."""
        if self._caster is not None:
            self._caster.close()


class _Lidar:
    """Buffers, rays and publisher of one lidar."""

    def __init__(self, settings: Settings, caster: Caster, publisher: Publisher[Any]) -> None:
        self._settings = settings
        self._caster = caster
        self._publisher = publisher
        self._frame = frame_of(settings)
        self._pattern = Rays(settings)
        self._groups = np.array(settings.hidden, np.int32)
        count = len(self._pattern.rays)
        self._distances = np.empty(count)
        self._geoms = np.empty(count, np.int32)
        self._too_close, self._no_return = np.empty(count, np.bool_), np.empty(count, np.bool_)

    def publish(self, data: mujoco.MjData, job: Job) -> None:
        settings, distances = self._settings, self._distances
        self._pattern.rotate(data.site_xmat[settings.site].reshape(3, 3))
        self._caster.cast(
            data.site_xpos[settings.site],
            self._pattern.rays,
            self._groups,
            settings.max_range + _RANGE_MARGIN,
            distances,
            self._geoms,
        )
        too_close, no_return = self._too_close, self._no_return
        np.less(distances, settings.min_range, out=too_close)
        np.greater(distances, settings.max_range, out=no_return)
        # MuJoCo returns -1 if a ray hits nothing.
        np.logical_or(no_return, distances < 0.0, out=no_return)
        if settings.noise_std or settings.dropout:
            self._add_noise(job)
        self._frame.write(distances, too_close, no_return)
        self._frame.message.set_stamp("header.stamp", job.time_ns)
        self._publisher.publish_frame(self._frame.message)

    def _add_noise(self, job: Job) -> None:
        """Adds noise and dropouts; they depend on the seed and the time only, not on earlier scans."""
        settings, distances = self._settings, self._distances
        rng = np.random.default_rng([*settings.seed, job.time_ns, job.lineage])
        if settings.noise_std:
            measured = ~(self._no_return | self._too_close)
            noisy = distances + settings.noise_std * rng.standard_normal(len(distances))
            # Noise changes the distance, not whether the ray has a return.
            np.copyto(distances, noisy.clip(settings.min_range, settings.max_range), where=measured)
        if settings.dropout:
            np.logical_or(self._no_return, rng.random(len(distances)) < settings.dropout, out=self._no_return)
