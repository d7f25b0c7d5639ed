"""What runs in the process: casts the rays of the lidars that are due, and publishes them."""

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

_BEYOND = 1e-9
"""How much beyond the longest distance MuJoCo still looks [m]; the distances are compared exactly afterwards."""


class LidarWork(Work):
    """Casts lidars; a task is the name of one.

    Args:
        lidars: The lidars, in the order of the publishers.
        threads: How many cast at the same time.
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
        """Casts and publishes; returns how long each took [s]."""
        assert self._caster is not None
        self._caster.pose(data)
        taken: dict[str, float] = {}
        # In one order, whatever that of the set: of two on one topic, the same one comes first.
        for name in sorted(job.tasks):
            began = perf_counter()
            self._lidars[name].publish(data, job)
            taken[name] = perf_counter() - began
        return taken

    def close(self) -> None:
        """Ends the threads."""
        if self._caster is not None:
            self._caster.close()


class _Lidar:
    """One lidar at work."""

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
        self._too_close, self._nothing = np.empty(count, np.bool_), np.empty(count, np.bool_)

    def publish(self, data: mujoco.MjData, job: Job) -> None:
        settings, distances = self._settings, self._distances
        self._pattern.turn(data.site_xmat[settings.site].reshape(3, 3))
        self._caster.cast(
            data.site_xpos[settings.site],
            self._pattern.rays,
            self._groups,
            settings.max_range + _BEYOND,
            distances,
            self._geoms,
        )
        too_close, nothing = self._too_close, self._nothing
        np.less(distances, settings.min_range, out=too_close)
        np.greater(distances, settings.max_range, out=nothing)
        # MuJoCo's -1 is none.
        np.logical_or(nothing, distances < 0.0, out=nothing)
        if settings.noise_std or settings.dropout:
            self._disturb(job)
        self._frame.write(distances, too_close, nothing)
        self._frame.message.set_stamp("header.stamp", job.time_ns)
        self._publisher.publish_frame(self._frame.message)

    def _disturb(self, job: Job) -> None:
        """Adds noise and takes rays away: the same ones for one state, whatever was cast before it."""
        settings, distances = self._settings, self._distances
        random = np.random.default_rng([*settings.seed, job.time_ns, job.epoch])
        if settings.noise_std:
            measured = ~(self._nothing | self._too_close)
            noisy = distances + settings.noise_std * random.standard_normal(len(distances))
            # Noise changes how far something is measured to be, not whether it is measured.
            np.copyto(distances, noisy.clip(settings.min_range, settings.max_range), where=measured)
        if settings.dropout:
            np.logical_or(self._nothing, random.random(len(distances)) < settings.dropout, out=self._nothing)
