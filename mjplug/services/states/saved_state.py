"""A saved state as data: a header of JSON values, and arrays."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mjplug.errors import RequestError
from mjplug.limits import MAX_SIMULATED_TIME
from mjplug.physics.part import SavedPart
from mjplug.physics.physics_state import PhysicsState
from mjplug.printable import one_line
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.mjplug_msgs import Snapshot

VECTOR, ASLEEP, RESULTS, PLUGINS = "vector", "asleep", "results/", "plugins/"
"""Names of arrays, or how they begin."""

Whole = Annotated[int, Field(ge=0, lt=1 << 63)]
Token = Annotated[str, Field(max_length=200, pattern="^[ -~]*$")]
"""A version or a digest, which is sent to clients."""


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class SavedTimer(_Section):
    """The phase of a timer.

    Attributes:
        period: The period [steps], as numerator and denominator.
        started: The step number from which the periods count, relative to the step of the state.
        due_now: Whether a firing at the step of the state has not happened yet.
    """

    period: tuple[int, int]
    started: Annotated[int, Field(gt=-(1 << 63), le=0)]
    due_now: bool


class PartHeader(_Section):
    """The JSON values of a part; see `SavedPart`. Its arrays are `plugins/<part>/<name>`."""

    values: dict[str, Any]
    left_out: str
    timers: dict[int, SavedTimer]


class Header(_Section):
    """The JSON values of a saved state.

    Attributes:
        format: Version of the format.
        mujoco: Version of MuJoCo.
        mjplug: Version of mjplug that has saved the state.
        model: Digest of the model.
        seed: The setting `sim.seed`.
        step: Steps taken.
        time_ns: Simulated time [ns].
        time_origin: The step number at which the time is zero.
        model_generation: Number of changes of the model until the state was saved.
        epoch: Resets and restored states.
        lineage: See `Simulation.lineage`.
        steps_since_reset: Steps since the last automatic reset, at most 10.
        updating: Whether any `update` is called before each step; it then replaces the applied forces.
        poses_current: See `PhysicsState`.
        sensors_current: See `PhysicsState`.
        digest: Digest of the state vector.
        parts: The parts by name.
        holds: Part and number of each velocity hold that holds, in the order in which they are applied.
    """

    format: Literal[1]
    mujoco: Token
    mjplug: Token
    model: Token
    seed: Whole
    step: Whole
    time_ns: Annotated[int, Field(ge=0, le=MAX_SIMULATED_TIME * 1_000_000_000)]
    epoch: Whole
    lineage: Whole
    steps_since_reset: Annotated[int, Field(ge=0, le=10)]
    updating: bool
    poses_current: bool
    sensors_current: bool
    digest: Token
    parts: dict[str, PartHeader]
    holds: tuple[tuple[str, Whole], ...]
    time_origin: Whole = 0
    model_generation: Whole = 0

    def to_json(self) -> bytes:
        """Returns the header as JSON; infinity is written as Python's `json` does."""
        return json.dumps(self.model_dump(), separators=(",", ":")).encode()

    @classmethod
    def from_json(cls, text: bytes) -> "Header":
        """Reads a header.

        Raises:
            RequestError: The JSON is not a valid header.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            place = ".".join(map(str, first["loc"]))[:200]
            raise RequestError(one_line(f"its header is invalid: {place}: {first['msg']}")) from None


@dataclass(frozen=True)
class SavedState:
    """A saved state.

    Attributes:
        header: Its JSON values.
        arrays: Its arrays by name.
    """

    header: Header
    arrays: Mapping[str, NDArray[Any]]

    @cached_property
    def size(self) -> int:
        """Size of the arrays and of the header [bytes]; the header counts with its largest part only."""
        texts = (len(str(part.values.get("saved", ""))) for part in self.header.parts.values())
        return sum(array.nbytes for array in self.arrays.values()) + sum(texts)

    @property
    def left_out(self) -> dict[str, str]:
        """Why the state of a plugin was not saved, by instance."""
        return {name: part.left_out for name, part in self.header.parts.items() if part.left_out}

    @cached_property
    def physics(self) -> PhysicsState:
        """The state of MuJoCo.

        Raises:
            RequestError: An array is missing.
        """
        arrays = self.arrays
        if VECTOR not in arrays or ASLEEP not in arrays:
            raise RequestError("the saved state contains no state vector")
        results = {name.removeprefix(RESULTS): array for name, array in arrays.items() if name.startswith(RESULTS)}
        header = self.header
        return PhysicsState(
            arrays[VECTOR],
            arrays[ASLEEP].astype(np.int32, copy=False),
            results,
            header.poses_current,
            header.sensors_current,
        )

    def part(self, name: str) -> SavedPart:
        """Returns the state of a part that the header contains."""
        header = self.header.parts[name]
        return SavedPart(header.values, dict(self._arrays_of_parts.get(name, {})), header.left_out)

    @cached_property
    def _arrays_of_parts(self) -> dict[str, dict[str, NDArray[Any]]]:
        """The arrays of each part by name. A state may be restored thousands of times, so they are searched once."""
        found: dict[str, dict[str, NDArray[Any]]] = {}
        for key, array in self.arrays.items():
            if key.startswith(PLUGINS):
                part, _, name = key.removeprefix(PLUGINS).partition("/")
                found.setdefault(part, {})[name] = array
        return found


def describe(name: str, file: bool, header: Header, size: int) -> Snapshot:
    """Returns the description of a saved state for clients.

    Args:
        name: Its name.
        file: Whether it is in a file.
        header: Its header.
        size: Its size [bytes].
    """
    return Snapshot(
        name=name,
        file=file,
        step=header.step,
        stamp=Time.from_ns(header.time_ns),
        epoch=header.epoch,
        model_generation=header.model_generation,
        model_digest=header.model,
        digest=header.digest,
        size=size,
        left_out=tuple(one_line(part) for part, saved in header.parts.items() if saved.left_out),
    )
