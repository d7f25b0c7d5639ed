"""The model and its state: stepping, divergence, saving and restoring. Physics thread only."""

from collections.abc import Sequence
from itertools import repeat
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import MjplugError, ModelError, UnknownName
from mjplug.limits import LONGEST_STEP, SHORTEST_STEP
from mjplug.near_names import Names
from mjplug.physics import divergence
from mjplug.physics.divergence import Divergence
from mjplug.physics.memory import Cleared, Saved, float_view
from mjplug.physics.step_time import StepTime
from mjplug.physics.velocity import VelocityHold

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_MOST_DIGITS = 10
_QPOS = int(mujoco.mjtWarning.mjWARN_BADQPOS)
_QVEL = int(mujoco.mjtWarning.mjWARN_BADQVEL)
_QACC = int(mujoco.mjtWarning.mjWARN_BADQACC)
_BODY, _JOINT, _KEY = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_KEY


class Simulation:
    """Owns mjModel and mjData, and counts steps.

    MuJoCo's own reaction to a bad state, a silent reset to `qpos0` and time 0, is switched off; `advance` reports it
    instead.

    Attributes:
        model: The compiled model.
        data: The live state.
        step: Steps taken since the start; a reset does not change it.
        epoch: Resets since the start.
        time: Converts step numbers to simulated time.
        free_joints: The free joint of every body that has one, body id to joint id, in joint order.
        free_bodies: Names of those bodies.

    Args:
        model: The compiled model; its AUTORESET flag is cleared.
        keyframe: Name or index of the keyframe to start from; empty means the model's default pose.

    Raises:
        UnknownName: There is no such keyframe.
        ModelError: The time step is too short or too long.
    """

    def __init__(self, model: mujoco.MjModel, keyframe: str = "") -> None:
        if not SHORTEST_STEP <= model.opt.timestep <= LONGEST_STEP:
            raise ModelError(
                f"the model's timestep is {model.opt.timestep:g} s; "
                f"it must be from {SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
            )
        self.model = model
        self.data = mujoco.MjData(model)
        self.step = 0
        self.epoch = 0
        self.time = StepTime(float(model.opt.timestep))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        # Made now, since a request with a wrong name must not take the physics thread's time.
        self._known = {
            _BODY: Names(self._names(_BODY, model.nbody)),
            _JOINT: Names(self._names(_JOINT, model.njnt)),
            _KEY: Names(self.keyframes()),
        }
        if keyframe:
            mujoco.mj_resetDataKeyframe(model, self.data, self.keyframe_id(keyframe))
        self.data.time = 0.0
        mujoco.mj_forward(model, self.data)
        self._initial = np.empty(mujoco.mj_stateSize(model, _STATE))
        self._checkpoint = Saved(_changed_by_steps(self.model, self.data))
        # `data.time` as of the last step that went well: MuJoCo's sum of time steps, not the bits of `time.seconds`.
        self._summed_time = self.data.time
        self._timestep = float(model.opt.timestep)
        self._forces = Cleared((self.data.xfrc_applied, self.data.qfrc_applied))
        mujoco.mj_getState(model, self.data, self._initial, _STATE)
        free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
        self.free_joints = dict(zip(model.jnt_bodyid[free].tolist(), free.tolist(), strict=True))
        self.free_bodies = Names(mujoco.mj_id2name(model, _BODY, body) or "" for body in self.free_joints)
        self._kinematics_current = True
        self._forwarded = 0
        self._warnings = self.data.warning.number.data
        self._qvel = float_view(self.data.qvel)
        self._holds: list[VelocityHold] = []
        self._holders: dict[int, str] = {}
        self._controllers: dict[int, str] = {}

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.time.ns(self.step)

    @property
    def sensor_step(self) -> int:
        """The step boundary that `sensordata` belongs to.

        A step computes the sensors first and integrates last, so that is the boundary before the last step, unless
        `forward` was called since.
        """
        return self.step if self._forwarded == self.step else self.step - 1

    def checkpoint(self) -> None:
        """Notes the state to go back to if the coming steps diverge."""
        self._checkpoint.save()

    def advance(self, steps: int) -> Divergence | None:
        """Takes physics steps; `checkpoint` must have been called at this boundary.

        Args:
            steps: How many, at least 1.

        Returns:
            None when all went well. Otherwise what diverged; the state and the step count are then those before the
            step that went wrong.

        Raises:
            MjplugError: MuJoCo cannot go on at all.
        """
        warnings = self._warnings
        try:
            if self._holds:
                self._step_holding(steps)
            else:
                mujoco.mj_step(self.model, self.data, steps)
        except mujoco.FatalError as error:
            raise MjplugError(
                f"MuJoCo gave up after step {self.step}: {error}; a larger <size memory> in the model may help"
            ) from error
        self._kinematics_current = False
        if warnings[_QPOS] or warnings[_QVEL] or warnings[_QACC]:
            return self._rewind(steps)
        self.step += steps
        # Of one step, the same sum as MuJoCo's: reading `data.time` takes several times as long.
        self._summed_time = self._summed_time + self._timestep if steps == 1 else self.data.time
        return None

    def velocity_hold(self, dofs: Sequence[int], owner: str) -> tuple[VelocityHold, set[str]]:
        """Returns what holds the velocities of some degrees of freedom, whatever physics does, and who else may.

        Raises:
            MjplugError: The model has no such degree of freedom.
        """
        hold = VelocityHold(dofs, self.model.nv, self._holds)
        others = {self._holders.setdefault(dof, owner) for dof in dofs} - {owner}
        return hold, others

    def claim_controls(self, actuators: Sequence[int], owner: str) -> dict[int, str]:
        """Notes who sets the controls of some actuators; returns those that others have claimed before, and who."""
        claimed = {actuator: self._controllers.setdefault(actuator, owner) for actuator in actuators}
        return {actuator: other for actuator, other in claimed.items() if other != owner}

    def clear_forces(self) -> None:
        """Sets `xfrc_applied` and `qfrc_applied` to zero."""
        self._forces.clear()

    def kinematics(self) -> None:
        """Brings body, geom and site poses up to the current positions.

        After a step they are one step older than `qpos`, because MuJoCo computes them first and integrates last.
        """
        if not self._kinematics_current:
            mujoco.mj_kinematics(self.model, self.data)
            self._kinematics_current = True

    def forward(self) -> None:
        """Brings everything derived from the state up to date, after the state was written."""
        mujoco.mj_forward(self.model, self.data)
        self._kinematics_current = True
        self._forwarded = self.step

    def positions_changed(self) -> None:
        """Notes that `qpos` was written, so that the next `kinematics` computes."""
        self._kinematics_current = False

    def keep_as_initial(self) -> None:
        """Makes the current state the initial one, which `restore` puts back, and brings what it implies up to date."""
        self.forward()
        mujoco.mj_getState(self.model, self.data, self._initial, _STATE)

    def restore(self, keyframe: int | None = None) -> None:
        """Puts the initial state, or a keyframe, back, with warnings and plugin state; simulated time goes on.

        Derived quantities are stale afterwards: call `forward`.
        """
        model, data = self.model, self.data
        if keyframe is None:
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, self._initial, _STATE)
        else:
            mujoco.mj_resetDataKeyframe(model, data, keyframe)
        data.time = self._summed_time = self.time.seconds(self.step)
        self._kinematics_current = False

    def keyframes(self) -> list[str]:
        """Returns what each of the model's keyframes is called: its name, or its index if it has none."""
        names = (mujoco.mj_id2name(self.model, _KEY, i) for i in range(self.model.nkey))
        return [name or str(index) for index, name in enumerate(names)]

    def keyframe_id(self, name: str) -> int:
        """Returns the id of a keyframe.

        Args:
            name: Its name, or its index, such as `0`. A keyframe that has a number as its name goes before the one
                that has it as its index.

        Raises:
            UnknownName: There is no such keyframe.
        """
        try:
            return self._id(_KEY, "keyframe", name)
        except UnknownName:
            # More digits would be no index of a keyframe, and take long to convert.
            if name.isascii() and name.isdecimal() and len(name) < _MOST_DIGITS and int(name) < self.model.nkey:
                return int(name)
            raise

    def body_id(self, name: str) -> int:
        """Returns the id of a body; `world` is 0.

        Raises:
            UnknownName: There is none of that name.
        """
        return self._id(_BODY, "body", name)

    def joint_id(self, name: str) -> int:
        """Returns the id of a joint.

        Raises:
            UnknownName: There is none of that name.
        """
        return self._id(_JOINT, "joint", name)

    def _id(self, kind: mujoco.mjtObj, word: str, name: str) -> int:
        found = mujoco.mj_name2id(self.model, kind, name) if name and "\0" not in name else -1
        if found < 0:
            raise UnknownName(word, name, self._known[kind])
        return found

    def _names(self, kind: mujoco.mjtObj, count: int) -> list[str]:
        names = (mujoco.mj_id2name(self.model, kind, i) for i in range(count))
        return [name for name in names if name]

    def _step_holding(self, steps: int) -> None:
        # What a step costs beyond MuJoCo's own time is decided here.
        step, model, data, qvel = mujoco.mj_step, self.model, self.data, self._qvel
        if steps == 1:
            for hold in self._holds:
                for dof, velocity in zip(hold.dofs, hold.velocities):  # noqa: B905 - they were checked
                    qvel[dof] = velocity
            step(model, data, 1)
            return
        held = [pair for hold in self._holds for pair in zip(hold.dofs, hold.velocities, strict=True)]
        for _ in repeat(None, steps):
            for dof, velocity in held:
                qvel[dof] = velocity
            step(model, data, 1)

    def _rewind(self, steps: int) -> Divergence:
        """Goes back to before the step that went wrong, and says what it was.

        A batch is repeated step by step from its checkpoint; MuJoCo is deterministic, so the same step goes wrong
        again. Should it not, the batch's beginning is where the world stays.
        """
        found = divergence.find(self.model, self.data)
        self._restore()
        if steps > 1:
            begin, first, began_at = self._checkpoint, self.step, self._summed_time
            self._checkpoint = Saved(_changed_by_steps(self.model, self.data))
            for _ in range(steps):
                self.checkpoint()
                again = self.advance(1)
                if again is not None:
                    return again
            self._checkpoint, self.step, self._summed_time = begin, first, began_at
            self._restore()
        if found is None:
            raise MjplugError("MuJoCo counted a bad state that it does not name")
        return found

    def _restore(self) -> None:
        self._checkpoint.restore()
        self.data.time = self._summed_time
        self._kinematics_current = False
        divergence.clear(self.data)


def _changed_by_steps(model: mujoco.MjModel, data: mujoco.MjData) -> list[NDArray[Any]]:
    """Returns the arrays that a step changes and the next one reads."""
    names = ["qpos", "qvel", "act", "qacc_warmstart", "plugin_state", "history"]
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        names.append("tree_asleep")
    # Not every release of MuJoCo has all of them.
    return [getattr(data, name) for name in names if hasattr(data, name)]
