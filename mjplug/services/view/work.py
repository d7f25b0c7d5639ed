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
import numpy as np

from mjplug.contracts.transport import BytesPublisher
from mjplug.contracts.work import Job, Work
from mjplug.physics.body_spring import Grip
from mjplug.services.view.catalogue import catalogue
from mjplug.services.view.frame import PAUSED, FrameWriter
from mjplug.services.view.overlays import KINDS, OverlayWriter
from mjplug.services.view.pack import build
from mjplug.services.view.state import StateWriter

SCENE: Final = "scene"
"""Task: make the drawing pack."""

MODEL: Final = "model"
"""Task: save the compiled model."""

FRAME: Final = "frame"
"""Task: publish a frame."""

STATE: Final = "state"
"""Task: publish the state."""

STREAMS: Final = (FRAME, STATE, *(f"overlay/{kind}" for kind in KINDS))
"""The tasks that publish, each on its own key below `@view/`."""

Context = tuple[bool, tuple[Grip, ...], int]
"""Whether the simulation is paused, what viewers drag, and the number of steps; the context of each job."""

_GZIP_LEVEL = 4

_MODEL_GZIP_LEVEL = 1
"""Higher levels take several times as long for a few percent of a saved model."""


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


@dataclass(frozen=True, slots=True)
class SavedModel:
    """The compiled model, for clients with the same version of MuJoCo.

    Attributes:
        mjb: The model in the format of `mj_saveModel`, gzip.
        mujoco: Version of MuJoCo; other versions refuse the file.
    """

    mjb: bytes
    mujoco: str


Report = Scene | SavedModel


class ViewWork(Work):
    """Publishes each task of `STREAMS` on the publisher at its place; `scene` and `model` return their `Report`."""

    def open(self, model: mujoco.MjModel, publishers: Sequence[BytesPublisher], logger: Logger) -> str:
        """Prepares the frames of a model."""
        self._publishers = dict(zip(STREAMS, publishers, strict=True))
        self._model = model
        self._writers: dict[str, FrameWriter | StateWriter] = {FRAME: FrameWriter(model), STATE: StateWriter(model)}
        self._overlays: OverlayWriter | None = None
        return ""

    def perform(self, data: mujoco.MjData, job: Job) -> tuple[Report, ...]:
        """Publishes the streams that are asked for, and returns the reports that are."""
        paused, grips, step = job.context
        for task, writer in self._writers.items():
            if task in job.tasks:
                flags = PAUSED if paused else 0
                self._publishers[task].put(writer.write(data, job.time_ns / 1e9, time.time(), job.epoch, step, flags))
        kinds = [kind for kind in KINDS if f"overlay/{kind}" in job.tasks]
        if kinds:
            self._draw(data, job, kinds, grips)
        reports: list[Report] = []
        if SCENE in job.tasks:
            reports.append(self._scene())
        if MODEL in job.tasks:
            reports.append(self._saved())
        return tuple(reports)

    def _draw(self, data: mujoco.MjData, job: Job, kinds: Sequence[str], grips: Sequence[Grip]) -> None:
        if self._overlays is None:
            self._overlays = OverlayWriter(self._model)
        # Contacts and forces are not part of the state.
        mujoco.mj_forward(self._model, data)
        for kind in kinds:
            overlay = self._overlays.write(data, kind, job.time_ns / 1e9, job.epoch, grips)
            self._publishers[f"overlay/{kind}"].put(overlay)

    def _scene(self) -> Scene:
        # Without a time stamp, so that equal models have equal hashes.
        pack = gzip.compress(build(self._model), _GZIP_LEVEL, mtime=0)
        text = json.dumps(catalogue(self._model), separators=(",", ":"), allow_nan=False)
        return Scene(pack, hashlib.sha256(pack).hexdigest(), text.encode())

    def _saved(self) -> SavedModel:
        buffer = np.empty((mujoco.mj_sizeModel(self._model), 1), np.uint8)
        mujoco.mj_saveModel(self._model, None, buffer)
        return SavedModel(gzip.compress(buffer.data, _MODEL_GZIP_LEVEL, mtime=0), mujoco.__version__)
