"""The model and its state: stepping, divergence detection, saving and restoring. Physics thread only."""

from collections.abc import Sequence
from itertools import repeat

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import MjplugError, ModelError, UnknownName
from mjplug.limits import MAX_TIMESTEP, MIN_TIMESTEP
from mjplug.physics import divergence, physics_state, sleep
from mjplug.physics.checkpoint import Checkpoint
from mjplug.physics.divergence import Divergence
from mjplug.physics.fitted import Fitted
from mjplug.physics.model_change import Replacement
from mjplug.physics.physics_state import PhysicsState
from mjplug.physics.step_time import StepTime
from mjplug.physics.velocity import VelocityHold

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_MAX_INDEX_DIGITS = 10
_QPOS = int(mujoco.mjtWarning.mjWARN_BADQPOS)
_QVEL = int(mujoco.mjtWarning.mjWARN_BADQVEL)
_QACC = int(mujoco.mjtWarning.mjWARN_BADQACC)
_BODY, _JOINT, _KEY = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_KEY


class Simulation:
    """Owns mjModel and mjData, and counts steps.

    MuJoCo's automatic reset of a diverged state to `qpos0` and time 0 is disabled; `advance` returns the divergence
    instead.

    Attributes:
        model: The compiled model.
        data: The current state.
        step: Steps taken since the start. A reset does not change it; restoring a state may set it to an earlier one.
        epoch: Resets and restored states since the start; it only grows.
        lineage: Resets in the past of the present state, or the number that a client has given it with a reset. Noise
            depends on it, so that it is the same again after a state was restored.
        time: Conversion between step numbers and simulated time.
        free_joints: Joint id of the free joint by body id, in joint order.
        free_bodies: Names of the bodies with a free joint.
        holds: The velocity holds that hold now, in the order in which they are written to `qvel`.
        generation: Number of changes of the model since the start.
        spawned: Names of the entities that were added to the model; `<name>/` is before the names in them.

    Args:
        model: The compiled model; its flag mjDSBL_AUTORESET is set.
        keyframe: Name or index of the keyframe to start from; empty means the model's default pose.

    Raises:
        UnknownName: There is no such keyframe.
        ModelError: The time step is too short or too long.
    """

    def __init__(self, model: mujoco.MjModel, keyframe: str = "") -> None:
        if not MIN_TIMESTEP <= model.opt.timestep <= MAX_TIMESTEP:
            raise ModelError(
                f"the model's timestep is {model.opt.timestep:g} s; "
                f"it must be between {MIN_TIMESTEP:g} and {MAX_TIMESTEP:g} s"
            )
        self.step = 0
        self.epoch = 0
        self.lineage = 0
        self.generation = 0
        self.spawned: tuple[str, ...] = ()
        self.time = StepTime(float(model.opt.timestep))
        self.holds: list[VelocityHold] = []
        self._holders: dict[int, str] = {}
        self._controllers: dict[int, str] = {}
        self._use(Fitted(model, mujoco.MjData(model)))
        if keyframe:
            mujoco.mj_resetDataKeyframe(model, self.data, self.keyframe_id(keyframe))
        self.data.time = 0.0
        mujoco.mj_forward(model, self.data)
        self._initial = np.empty(mujoco.mj_stateSize(model, _STATE))
        # `data.time` after the last valid step. It is MuJoCo's sum of time steps, which `time.seconds` does not equal.
        self._summed_time = self.data.time
        self._timestep = float(model.opt.timestep)
        mujoco.mj_getState(model, self.data, self._initial, _STATE)
        self._kinematics_current = True
        self._forwarded = 0

    def _use(self, fitted: Fitted) -> None:
        """Uses a model with its state from now on."""
        self._fitted = fitted
        self.model, self.data = fitted.model, fitted.data
        self.free_joints, self.free_bodies = fitted.free_joints, fitted.free_bodies
        # Attributes of this object, because they are read at every step.
        self._checkpoint, self._forces = fitted.checkpoint, fitted.forces
        self._warnings, self._qvel = fitted.warnings, fitted.qvel

    @property
    def initial(self) -> NDArray[np.float64]:
        """A copy of the initial state mjSTATE_INTEGRATION, which `restore` sets."""
        return self._initial.copy()

    @property
    def body_names(self) -> list[str]:
        """The names of all bodies."""
        known = self._fitted.known[_BODY]
        return known.first(len(known))

    def replace(self, replacement: Replacement) -> None:
        """Uses a changed model from now on, with the present state of all elements that are still there.

        Velocity holds end, and derived quantities are computed. Step number and time continue.
        """
        before = self.data
        self._use(replacement.fitted)
        replacement.transfer.copy(before, self.data)
        mujoco.mj_forward(self.model, self.data)
        # What MuJoCo computes for the next step starts from the same values as it would have without the change.
        replacement.transfer.copy(before, self.data)
        self._initial = replacement.initial
        self.spawned = replacement.spawned
        self.generation = replacement.change.generation
        for hold in tuple(self.holds):
            hold.release()
        self._holders.clear()
        self._controllers.clear()
        self._summed_time = self.data.time
        self._kinematics_current = True
        self._forwarded = self.step

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.time.ns(self.step)

    @property
    def sensor_step(self) -> int:
        """Number of steps taken before the state from which `sensordata` was computed.

        A step computes the sensors first and integrates last, so this is one less than `step`, unless `forward` was
        called after the last step.
        """
        return self.step if self._forwarded == self.step else self.step - 1

    def checkpoint(self) -> None:
        """Saves the state, which `advance` restores if the next steps diverge."""
        self._checkpoint.save()

    def advance(self, steps: int) -> Divergence | None:
        """Takes physics steps; call `checkpoint` first.

        Args:
            steps: Number of steps, at least 1.

        Returns:
            None if no step diverged. Otherwise the divergence; the state and the step count are then those before the
            step that diverged.

        Raises:
            MjplugError: MuJoCo raised a fatal error.
        """
        warnings = self._warnings
        try:
            if self.holds:
                self._step_holding(steps)
            else:
                mujoco.mj_step(self.model, self.data, steps)
        except mujoco.FatalError as error:
            raise MjplugError(
                f"MuJoCo stopped with a fatal error after step {self.step}: {error}; "
                "try a larger <size memory> in the model"
            ) from error
        self._kinematics_current = False
        if warnings[_QPOS] or warnings[_QVEL] or warnings[_QACC]:
            return self._rewind(steps)
        self.step += steps
        # For one step this is the same sum as MuJoCo's; reading `data.time` takes several times as long.
        self._summed_time = self._summed_time + self._timestep if steps == 1 else self.data.time
        return None

    def velocity_hold(self, dofs: Sequence[int], owner: str) -> tuple[VelocityHold, set[str]]:
        """Creates a hold on the velocities of some degrees of freedom.

        Args:
            dofs: Indices in `qvel`.
            owner: Name of the plugin instance that uses the hold.

        Returns:
            The hold, and the names of other owners of holds on the same degrees of freedom.

        Raises:
            MjplugError: The model has no such degree of freedom.
        """
        hold = VelocityHold(dofs, self.model.nv, self.holds)
        others = {self._holders.setdefault(dof, owner) for dof in dofs} - {owner}
        return hold, others

    def claim_controls(self, actuators: Sequence[int], owner: str) -> dict[int, str]:
        """Registers the owner of some controls; the first owner of a control stays registered.

        Args:
            actuators: Indices in `ctrl`.
            owner: Name of the plugin instance that sets the controls.

        Returns:
            The registered owner by actuator, for the actuators that another owner has claimed before.
        """
        claimed = {actuator: self._controllers.setdefault(actuator, owner) for actuator in actuators}
        return {actuator: other for actuator, other in claimed.items() if other != owner}

    def clear_forces(self) -> None:
        """Sets `xfrc_applied` and `qfrc_applied` to zero."""
        self._forces.clear()

    def kinematics(self) -> None:
        """Computes body, geom and site poses from the current positions.

        After a step, these poses are one step older than `qpos`, because MuJoCo computes them first and integrates
        last.
        """
        if not self._kinematics_current:
            mujoco.mj_kinematics(self.model, self.data)
            self._kinematics_current = True

    def forward(self) -> None:
        """Computes all quantities that are derived from the state; call it after writing the state."""
        mujoco.mj_forward(self.model, self.data)
        self._kinematics_current = True
        self._forwarded = self.step

    def mark_poses_outdated(self) -> None:
        """Marks body poses as out of date, so that `kinematics` computes them. Call it after writing `qpos`."""
        self._kinematics_current = False

    def keep_as_initial(self) -> None:
        """Makes the current state the initial state, which `restore` sets, and updates all derived quantities."""
        self.forward()
        mujoco.mj_getState(self.model, self.data, self._initial, _STATE)

    def restore(self, keyframe: int | None = None) -> None:
        """Sets the initial state or a keyframe, resets warnings and plugin state, and keeps simulated time.

        Derived quantities are out of date afterwards; call `forward`.

        Args:
            keyframe: Id of the keyframe; None means the initial state.
        """
        model, data = self.model, self.data
        if keyframe is None:
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, self._initial, _STATE)
        else:
            mujoco.mj_resetDataKeyframe(model, data, keyframe)
        data.time = self._summed_time = self.time.seconds(self.step)
        # The initial state, and what precedes a keyframe, end at time 0.
        physics_state.shift(model, data, data.time)
        self._kinematics_current = False

    def save(self) -> PhysicsState:
        """Returns a copy of the state."""
        asleep = self.data.tree_asleep if sleep.sleeps(self.model) else np.empty(0, np.int32)
        return PhysicsState(
            physics_state.vector_of(self.model, self.data),
            asleep.copy(),
            {name: array.copy() for name, array in self._result_arrays().items()},
            self._kinematics_current,
            self._forwarded == self.step,
        )

    def check(self, state: PhysicsState) -> None:
        """Checks that a state fits the model.

        Raises:
            RequestError: It does not fit.
        """
        physics_state.check(self.model, state, self._result_arrays())

    def put_back(self, state: PhysicsState, step: int | None) -> None:
        """Sets a state that `check` has accepted, with the results of its last step.

        Args:
            state: The state.
            step: Number of steps taken before the state; None keeps the present number, and thus simulated time.
        """
        time = self.time.seconds(self.step) if step is None else None
        physics_state.put_back(self.model, self.data, state, self._result_arrays(), time)
        if step is not None:
            self.step = step
        self._summed_time = self.data.time
        self._kinematics_current = state.poses_current
        self._forwarded = self.step if state.sensors_current else -1

    def spawned_owner(self, body: str) -> str:
        """Returns the name of the spawned entity to which a body belongs, or the name of the body."""
        owner = body.partition("/")[0]
        return owner if owner in self.spawned else body

    def put_back_forces(self, state: PhysicsState) -> None:
        """Sets `xfrc_applied` and `qfrc_applied` of a state that `check` has accepted."""
        physics_state.put_back_forces(self.model, self.data, state)

    def keyframes(self) -> list[str]:
        """Returns the name of each keyframe, or its index if it is unnamed."""
        return self._fitted.keyframes

    def keyframe_id(self, name: str) -> int:
        """Returns the id of a keyframe.

        Args:
            name: Its name, or its index, such as `0`. If a number is both a name and an index, the name counts.

        Raises:
            UnknownName: There is no such keyframe.
        """
        try:
            return self._id(_KEY, "keyframe", name)
        except UnknownName:
            # A longer number is not an index, and converting it may take long.
            if name.isascii() and name.isdecimal() and len(name) < _MAX_INDEX_DIGITS and int(name) < self.model.nkey:
                return int(name)
            raise

    def body_id(self, name: str) -> int:
        """Returns the id of a body; the id of `world` is 0.

        Raises:
            UnknownName: There is no body of that name.
        """
        return self._id(_BODY, "body", name)

    def joint_id(self, name: str) -> int:
        """Returns the id of a joint.

        Raises:
            UnknownName: There is no joint of that name.
        """
        return self._id(_JOINT, "joint", name)

    def _result_arrays(self) -> dict[str, NDArray[np.float64]]:
        return self._fitted.results

    def _id(self, kind: mujoco.mjtObj, word: str, name: str) -> int:
        found = mujoco.mj_name2id(self.model, kind, name) if name and "\0" not in name else -1
        if found < 0:
            raise UnknownName(word, name, self._fitted.known[kind])
        return found

    def _step_holding(self, steps: int) -> None:
        # This code runs at every step, so it is written for speed.
        step, model, data, qvel = mujoco.mj_step, self.model, self.data, self._qvel
        if steps == 1:
            for hold in self.holds:
                for dof, velocity in zip(hold.dofs, hold.velocities):  # noqa: B905 - `set` checked the lengths
                    qvel[dof] = velocity
            step(model, data, 1)
            return
        held = [pair for hold in self.holds for pair in zip(hold.dofs, hold.velocities, strict=True)]
        for _ in repeat(None, steps):
            for dof, velocity in held:
                qvel[dof] = velocity
            step(model, data, 1)

    def _rewind(self, steps: int) -> Divergence:
        """Restores the state before the step that diverged, and returns the divergence.

        A batch is repeated step by step from its checkpoint. MuJoCo is deterministic, so the same step diverges again.
        If none does, the state at the start of the batch is restored.
        """
        found = divergence.find(self.model, self.data)
        self._restore()
        if steps > 1:
            begin, first, began_at = self._checkpoint, self.step, self._summed_time
            self._checkpoint = Checkpoint(self.model, self.data)
            for _ in range(steps):
                self.checkpoint()
                again = self.advance(1)
                if again is not None:
                    return again
            self._checkpoint, self.step, self._summed_time = begin, first, began_at
            self._restore()
        if found is None:
            raise MjplugError("MuJoCo reported an invalid state, but not which coordinate is invalid")
        return found

    def _restore(self) -> None:
        self._kinematics_current = self._checkpoint.restore()
        if self._kinematics_current:
            self._forwarded = self.step
        self.data.time = self._summed_time
        divergence.clear(self.data)
