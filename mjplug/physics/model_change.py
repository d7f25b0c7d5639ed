"""A change of the model while the simulation runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjplug.physics.fitted import Fitted
from mjplug.physics.transfer import Transfer


def _nothing() -> None:
    pass


@dataclass(frozen=True, slots=True)
class ModelChange:
    """What has changed, as plugins get it.

    Attributes:
        generation: Number of changes of the model since the start.
        added: Names of the entities that were added.
        removed: Names of the entities that were removed.
        maps: For each kind of element, the new id of each old one, -1 if it is gone: `body`, `joint`, `geom`, `site`,
            `camera`, `light`, `actuator`, `sensor`, `tendon`, `equality`.
        digest: Identifies the model; see `model_digest`.
        restart: Starts the plugin instance anew: `cleanup`, `init` and `restore`; see `Plugin.on_model_changed`.
    """

    generation: int
    added: tuple[str, ...]
    removed: tuple[str, ...]
    maps: Mapping[str, NDArray[np.int64]]
    digest: str = ""
    restart: Callable[[], None] = _nothing


@dataclass(frozen=True, slots=True)
class Replacement:
    """A changed model that was prepared in another thread.

    Attributes:
        fitted: The model with its state.
        transfer: Copies the state of the present model.
        initial: The initial state mjSTATE_INTEGRATION of the new model.
        spawned: Names of the spawned entities in it.
        change: What plugins get.
    """

    fitted: Fitted
    transfer: Transfer
    initial: NDArray[np.float64]
    spawned: tuple[str, ...]
    change: ModelChange
