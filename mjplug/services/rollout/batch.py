"""A batch of open-loop simulations on the threads of `mujoco.rollout`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from mjplug.errors import RequestError, UnknownName

Array = NDArray[np.float64]

OBSERVABLE = ("qpos", "qvel", "act", "sensordata", "ctrl")
"""The arrays that a batch returns; `mujoco.rollout` records no others."""

MAX_STEPS = 1_000_000
"""Maximum number of steps of one sequence."""

MAX_RECORDED = 1 << 25
"""Maximum number of float64 values that are recorded of one sequence, which is not divided; 256 MiB."""

_CHUNK_VALUES = 1 << 22
"""Number of float64 values for which memory is allocated at a time, unless one sequence has more; 32 MiB."""

_STATE = mujoco.mjtState
_FULL = int(_STATE.mjSTATE_FULLPHYSICS)
_INTEGRATION = int(_STATE.mjSTATE_INTEGRATION)
_CONSTANT = (_STATE.mjSTATE_EQ_ACTIVE, _STATE.mjSTATE_MOCAP_POS, _STATE.mjSTATE_MOCAP_QUAT, _STATE.mjSTATE_USERDATA)
"""Inputs that keep their values from the start during a sequence. Forces of plugins act for one step only, so they are
zero in all steps."""


@dataclass(frozen=True, slots=True)
class Sequences:
    """Sequences of controls from one state.

    Attributes:
        start: The state mjSTATE_INTEGRATION.
        controls: Controls of B sequences of k actions, shape (B, k, nu).
        steps: Number of physics steps for each action.
        observe: Names of the arrays to return.
    """

    start: Array
    controls: Array
    steps: int
    observe: tuple[str, ...]


class Batch:
    """Simulates batches on a pool of threads. One thread at a time may call `run`.

    Attributes:
        model: The model.

    Args:
        model: As above; it is only read.
        threads: Number of threads.
    """

    def __init__(self, model: mujoco.MjModel, threads: int) -> None:
        self.model = model
        self._rollout = Rollout(nthread=threads)
        self._data = [mujoco.MjData(model) for _ in range(max(1, threads))]

    def run(self, sequences: Sequences, stopped: Callable[[], bool]) -> tuple[Array, list[int]]:
        """Simulates all sequences.

        Args:
            sequences: The sequences.
            stopped: Returns whether to end early; the rest of the result is then undefined.

        Returns:
            The observed arrays, one after the other, shape (B, k, width), and the numbers of the sequences that have
            diverged; their rows are invalid from there on.
        """
        model, steps = self.model, sequences.steps
        batch, actions, _ = sequences.controls.shape
        full, warmstart, constant, spec = self._inputs(sequences.start)
        nstep = actions * steps
        nstate = full.size
        result = np.empty((batch, actions, sum(widths(model, sequences.observe))))
        diverged: list[int] = []
        chunk = max(1, _CHUNK_VALUES // (nstep * _recorded(model)))
        # The same sum as MuJoCo's.
        last_time = np.cumsum(np.append(full[0], np.full(nstep, model.opt.timestep)))[-1]
        for begin in range(0, batch, chunk):
            if stopped():
                break
            rows = sequences.controls[begin : begin + chunk]
            control = np.empty((len(rows), nstep, model.nu + constant.size))
            control[:, :, : model.nu] = np.repeat(rows, steps, axis=1)
            control[:, :, model.nu :] = constant
            state, sensors = self._rollout.rollout(
                [model],
                self._data,
                full,
                control if control.size else None,
                control_spec=spec,
                nstep=nstep,
                initial_warmstart=warmstart,
                state=np.empty((len(rows), nstep, nstate)),
                sensordata=np.empty((len(rows), nstep, model.nsensordata)),
            )
            last = slice(steps - 1, None, steps)
            self._observe(sequences.observe, state[:, last], sensors[:, last], rows, result[begin : begin + chunk])
            # The state begins with the time. MuJoCo ends a sequence at its first warning, and repeats the last state.
            ended_early = state[:, -1, 0] != last_time
            diverged += [begin + int(i) for i in np.flatnonzero(_invalid(state) | ended_early)]
        return result, diverged

    def close(self) -> None:
        """Ends the threads."""
        self._rollout.close()

    def _inputs(self, start: Array) -> tuple[Array, Array, Array, int]:
        """Returns the parts of a start: FULLPHYSICS, the warmstart, the constant inputs, and the spec of controls."""
        model, data = self.model, self._data[0]
        mujoco.mj_setState(model, data, start, _INTEGRATION)
        full = _state(model, data, _FULL)
        warmstart = _state(model, data, int(_STATE.mjSTATE_WARMSTART))
        kept = 0
        for part in _CONSTANT:
            if mujoco.mj_stateSize(model, int(part)):
                kept |= int(part)
        constant = _state(model, data, kept) if kept else np.empty(0)
        return full, warmstart, constant, kept | int(_STATE.mjSTATE_CTRL)

    def _observe(self, names: Sequence[str], state: Array, sensors: Array, controls: Array, out: Array) -> None:
        model = self.model
        # The state begins with the time.
        qvel = 1 + model.nq
        act = qvel + model.nv
        sources = {
            "qpos": state[..., 1:qvel],
            "qvel": state[..., qvel:act],
            "act": state[..., act : act + model.na],
            "sensordata": sensors,
            "ctrl": controls,
        }
        begin = 0
        for name in names:
            source = sources[name]
            out[..., begin : begin + source.shape[-1]] = source
            begin += source.shape[-1]


def widths(model: mujoco.MjModel, names: Sequence[str]) -> tuple[int, ...]:
    """Returns the number of values of each array.

    Raises:
        RequestError: There is no such array.
    """
    sizes = {"qpos": model.nq, "qvel": model.nv, "act": model.na, "sensordata": model.nsensordata, "ctrl": model.nu}
    for name in names:
        if name not in sizes:
            raise UnknownName("array in observe", name, OBSERVABLE)
    return tuple(sizes[name] for name in names)


def check_steps(model: mujoco.MjModel, steps: int, actions: int) -> None:
    """Checks the length of a sequence.

    Raises:
        RequestError: It has no step, or too many steps for this model.
    """
    if not steps:
        raise RequestError("steps is 0; it must be at least 1")
    if steps * actions > MAX_STEPS:
        raise RequestError(f"a sequence has {actions} * {steps} steps; at most {MAX_STEPS} are accepted")
    most = MAX_RECORDED // _recorded(model)
    if steps * actions > most:
        raise RequestError(
            f"a sequence has {actions} * {steps} steps; at most {most} are accepted for this model, because the state "
            "after each step is kept until the sequence ends"
        )


def _recorded(model: mujoco.MjModel) -> int:
    """Returns the number of float64 values that are kept for each step: inputs, state and sensors."""
    inputs = sum(mujoco.mj_stateSize(model, int(part)) for part in _CONSTANT)
    return int(mujoco.mj_stateSize(model, _FULL)) + model.nsensordata + model.nu + inputs


def _state(model: mujoco.MjModel, data: mujoco.MjData, spec: int) -> Array:
    out = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, out, spec)
    return out


def _invalid(state: Array) -> NDArray[np.bool_]:
    """Returns, for each sequence, whether a value is not finite or too large; shape (B,)."""
    # NaN fails the comparison too.
    valid = (np.abs(state) < mujoco.mjMAXVAL).all(axis=(1, 2))
    return np.asarray(~valid, dtype=np.bool_)
