"""Everything that MuJoCo's next steps and the results of the last step depend on, as data. Physics thread only."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError
from mjplug.physics import sleep

Array = NDArray[np.float64]

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)

_FORCES = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED | mujoco.mjtState.mjSTATE_XFRC_APPLIED)

_BEFORE_HISTORY = int(
    mujoco.mjtState.mjSTATE_TIME
    | mujoco.mjtState.mjSTATE_QPOS
    | mujoco.mjtState.mjSTATE_QVEL
    | mujoco.mjtState.mjSTATE_ACT
)
"""The parts of a state vector before the buffers of delayed actuators and sensors."""

_IN_VECTOR = frozenset(
    {
        "qpos",
        "qvel",
        "act",
        "history",
        "qacc_warmstart",
        "ctrl",
        "qfrc_applied",
        "xfrc_applied",
        "mocap_pos",
        "mocap_quat",
        "userdata",
        "plugin_state",
    }
)
"""Arrays that mjSTATE_INTEGRATION contains."""


@dataclass(frozen=True, slots=True)
class PhysicsState:
    """The state of MuJoCo between two steps.

    Attributes:
        vector: mjSTATE_INTEGRATION. It is all that the next steps depend on, except `asleep`.
        asleep: `tree_asleep`, shape (ntree,), which is in no state of MuJoCo; empty if the model does not sleep.
        results: What the last step computed, such as `sensordata`: the arrays of mjData with a fixed size, by name.
            Plugins read them until the next step replaces them. Contacts are not among them.
        poses_current: Whether the body poses in `results` are those of the positions in `vector`.
        sensors_current: Whether the sensors in `results` are those of `vector`, instead of those before the last step.
    """

    vector: Array
    asleep: NDArray[np.int32]
    results: Mapping[str, Array]
    poses_current: bool
    sensors_current: bool


def digest(vector: Array) -> str:
    """Returns the SHA-256 of a state vector as little-endian float64, hexadecimal."""
    return hashlib.sha256(vector.astype("<f8", copy=False).tobytes()).hexdigest()


def vector_of(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Returns the present mjSTATE_INTEGRATION."""
    vector = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, vector, _STATE)
    return vector


def result_arrays(data: mujoco.MjData) -> dict[str, Array]:
    """Returns the arrays of float64 in mjData's fixed buffer, without those of the state, by name.

    They are values only. Arrays of indices are left out, because MuJoCo does not check them.
    """
    if not data.qpos.size:
        return {}
    # The buffer begins with qpos. Other arrays belong to the arena, and their sizes change with the contacts.
    begin, end = data.qpos.ctypes.data, data.qpos.ctypes.data + int(data.nbuffer)
    found: dict[str, Array] = {}
    for name in dir(data):
        array = None if name.startswith("_") or name in _IN_VECTOR else getattr(data, name, None)
        if isinstance(array, np.ndarray) and array.dtype == np.float64 and begin <= array.ctypes.data < end:
            found[name] = array
    return found


def check(model: mujoco.MjModel, state: PhysicsState, results: Mapping[str, Array]) -> None:
    """Checks that a state fits the model, and that MuJoCo can read it safely.

    Args:
        model: The model.
        state: The state.
        results: The arrays that `result_arrays` returns for the model's data.

    Raises:
        RequestError: The state does not fit.
    """
    size = mujoco.mj_stateSize(model, _STATE)
    _require(state.vector.dtype == np.float64 and state.vector.shape == (size,), f"its vector must have {size} values")
    _require(np.isfinite(state.vector[0]), "its time is not finite")
    # MuJoCo would report a divergence, but plugins read positions before the step.
    motion = np.abs(state.vector[1 : 1 + model.nq + model.nv])
    _require((motion < mujoco.mjMAXVAL).all(), "a position or velocity is NaN, infinite or above 1e10")
    shapes = {name: array.shape for name, array in results.items()}
    given = {name: array.shape for name, array in state.results.items()}
    _require(given == shapes, "the results of its last step have other sizes")
    _require(all(array.dtype == np.float64 for array in state.results.values()), "its results are not float64")
    _check_asleep(model, state.asleep)
    _check_history(model, state.vector)


def put_back(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    state: PhysicsState,
    results: Mapping[str, Array],
    time: float | None = None,
) -> None:
    """Sets a state that `check` has accepted.

    Args:
        model: The model.
        data: Gets the state.
        state: The state.
        results: The arrays that `result_arrays` returns for `data`.
        time: The time to set [s]; None sets that of the state, bit by bit.
    """
    mujoco.mj_resetData(model, data)
    _set(model, data, state)
    # For what is not in `results`, such as contacts.
    mujoco.mj_forward(model, data)
    _set(model, data, state)
    for name, array in results.items():
        array[...] = state.results[name]
    if time is not None:
        shift(model, data, time - data.time)
        data.time = time


def put_back_forces(model: mujoco.MjModel, data: mujoco.MjData, state: PhysicsState) -> None:
    """Sets the applied forces of a state that `check` has accepted."""
    forces = np.empty(mujoco.mj_stateSize(model, _FORCES))
    mujoco.mj_extractState(model, state.vector, _STATE, forces, _FORCES)
    mujoco.mj_setState(model, data, forces, _FORCES)


def shift(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
    """Shifts the times of the samples in the buffers of delayed actuators and sensors [s]."""
    for kind, count, begin in _buffers(model):
        data.history[begin + 2 : begin + 2 + count] += seconds
        if kind == "sensor":
            # The time of the last sample.
            data.history[begin] += seconds


def _set(model: mujoco.MjModel, data: mujoco.MjData, state: PhysicsState) -> None:
    mujoco.mj_setState(model, data, state.vector, _STATE)
    if state.asleep.size:
        data.tree_asleep[:] = state.asleep
        sleep.derive_awake(model, data)


def _check_asleep(model: mujoco.MjModel, asleep: NDArray[np.int32]) -> None:
    shape = (model.ntree,) if sleep.sleeps(model) else (0,)
    _require(asleep.dtype == np.int32 and asleep.shape == shape, "tree_asleep has another size")
    _require(sleep.is_valid(asleep), "tree_asleep is invalid")


def _check_history(model: mujoco.MjModel, vector: Array) -> None:
    """Checks the positions in the buffers of delayed actuators and sensors, which MuJoCo uses as indices."""
    history = vector[mujoco.mj_stateSize(model, _BEFORE_HISTORY) :]
    for kind, count, begin in _buffers(model):
        _require(float(history[begin + 1]) in range(count), f"the buffer of a delayed {kind} is invalid")


def _buffers(model: mujoco.MjModel) -> Iterator[tuple[str, int, int]]:
    """Yields the buffers of delayed actuators and sensors: kind, number of samples, begin in `history`.

    A buffer contains one number for MuJoCo's use, the index of the newest sample, the times, and the values.
    """
    if not getattr(model, "nhistory", 0):
        return
    for kind in ("actuator", "sensor"):
        samples = getattr(model, f"{kind}_history")[:, 0].tolist()
        begins = getattr(model, f"{kind}_historyadr").tolist()
        yield from ((kind, count, begin) for count, begin in zip(samples, begins, strict=True) if count > 0)


def _require(valid: object, problem: str) -> None:
    if not valid:
        raise RequestError(f"the saved state does not fit the model: {problem}")
