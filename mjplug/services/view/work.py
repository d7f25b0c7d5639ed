"""The work of the view's worker process: it makes the drawing pack once, and a frame of each state."""

import gzip
import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from logging import Logger
from typing import Final

import mujoco

from mjplug.contracts.transport import BytesPublisher
from mjplug.contracts.work import Job, Work
from mjplug.physics.step_time import StepTime
from mjplug.services.view.catalogue import catalogue
from mjplug.services.view.frame import PAUSED, FrameWriter
from mjplug.services.view.overlays import KINDS, OverlayWriter
from mjplug.services.view.pack import build

SCENE: Final = "scene"
"""Task: make the drawing pack."""

FRAME: Final = "frame"
"""Task: publish a frame."""

PAUSE: Final = "paused"
"""Marks that the simulation is paused in this state."""

STREAMS: Final = (FRAME, *(f"overlay/{kind}" for kind in KINDS))
"""The tasks that publish, each on its own key below `@view/`."""

_GZIP_LEVEL = 4


@dataclass(frozen=True, slots=True)
class Scene:
    """The drawing pack and what describes the model.

    Attributes:
        pack: The drawing pack, gzip.
        sha256: Hash of `pack`, hexadecimal.
        catalogue: Names and limits of the model, in JSON; see `catalogue.catalogue`.
    """

    pack: bytes
    sha256: str
    catalogue: bytes


class ViewWork(Work):
    """Publishes each task of `STREAMS` on the publisher at its place; the task `scene` returns a `Scene`."""

    def open(self, model: mujoco.MjModel, publishers: Sequence[BytesPublisher], logger: Logger) -> str:
        """Prepares the frames of a model."""
        self._publishers = dict(zip(STREAMS, publishers, strict=True))
        self._model = model
        self._step_ns = 1e9 * float(StepTime(float(model.opt.timestep)).timestep)
        self._frames = FrameWriter(model)
        self._overlays: OverlayWriter | None = None
        return ""

    def perform(self, data: mujoco.MjData, job: Job) -> Scene | None:
        """Publishes the streams that are asked for, and returns the scene if it is."""
        if FRAME in job.tasks:
            flags = PAUSED if PAUSE in job.tasks else 0
            step = round(job.time_ns / self._step_ns)
            frame = self._frames.write(data, job.time_ns / 1e9, time.time(), job.epoch, step, flags)
            self._publishers[FRAME].put(frame)
        kinds = [kind for kind in KINDS if f"overlay/{kind}" in job.tasks]
        if kinds:
            self._draw(data, job, kinds)
        if SCENE not in job.tasks:
            return None
        # Without a time stamp, so that equal models have equal hashes.
        pack = gzip.compress(build(self._model), _GZIP_LEVEL, mtime=0)
        text = json.dumps(catalogue(self._model), separators=(",", ":"), allow_nan=False)
        return Scene(pack, hashlib.sha256(pack).hexdigest(), text.encode())

    def _draw(self, data: mujoco.MjData, job: Job, kinds: Sequence[str]) -> None:
        if self._overlays is None:
            self._overlays = OverlayWriter(self._model)
        # Contacts and forces are not part of the state.
        mujoco.mj_forward(self._model, data)
        for kind in kinds:
            overlay = self._overlays.write(data, kind, job.time_ns / 1e9, job.epoch)
            self._publishers[f"overlay/{kind}"].put(overlay)
