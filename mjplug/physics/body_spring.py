"""A spring between a point of a body and a target, as in MuJoCo's viewer (`mjv_applyPerturbForce`)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.frames import Array, compose, rotate
from mjplug.physics.simulation import Simulation

Grip = tuple[int, tuple[float, ...] | None, tuple[float, ...] | None, tuple[float, ...] | None]
"""The body's id, the point in its frame [m], the position of the target [m] and orientation, w first."""

_TRANSLATE, _ROTATE = int(mujoco.mjtPertBit.mjPERT_TRANSLATE), int(mujoco.mjtPertBit.mjPERT_ROTATE)


class BodySpring:
    """Pulls a point of a body towards a target, or turns the body towards an orientation. Physics thread only.

    The stiffness is that of `visual/map` of the model, times the mass that is felt at the point; the damping is
    critical. Like MuJoCo's viewer, a body that is both pulled and turned gets the torque for turning only.

    Attributes:
        dynamic: Whether forces act on the body; they do not on a mocap body, which `place` moves.

    Args:
        simulation: The simulation.
        body: The body's id.
        local: The point in the body's frame [m], shape (3,).

    Raises:
        RequestError: The body cannot move.
    """

    def __init__(self, simulation: Simulation, body: int, local: Sequence[float]) -> None:
        model = simulation.model
        self.dynamic = bool(model.body_dofnum[model.body_weldid[body]] > 0)
        mocap = bool(model.body_mocapid[body] >= 0)
        if not (self.dynamic or mocap):
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or str(body)
            raise RequestError(f"body {name!r} cannot be dragged, because it is fixed to the world")
        root = int(model.body_rootid[body])
        self._placeable = mocap or root in simulation.free_joints
        self._simulation = simulation
        self._body = body
        self._local = np.array(local, np.float64)
        self._point = _tuple(local)
        self._grip: Grip = (body, self._point, None, None)
        self._force = simulation.data.xfrc_applied[body]
        self._target: Array | None = None
        self._quat: Array | None = None
        self._perturbation = mujoco.MjvPerturb()
        self._perturbation.select = body
        self._perturbation.flexselect = -1
        self._perturbation.localpos = self._local
        self._perturbation.localmass = self._mass() if self.dynamic else 1.0

    @property
    def grip(self) -> Grip:
        """What is pulled, and where to."""
        return self._grip

    def set(self, target: Sequence[float] | None, quat: Sequence[float] | None) -> None:
        """Sets the target from the next step on.

        Args:
            target: Position of the point in the world frame [m], shape (3,); None does not pull.
            quat: Orientation of the body in the world frame, unit quaternion with w first, shape (4,); None does not
                turn.
        """
        model, perturbation = self._simulation.model, self._perturbation
        self._target = None if target is None else np.array(target, np.float64)
        self._quat = None if quat is None else np.array(quat, np.float64)
        self._grip = (self._body, self._point, _tuple(target), _tuple(quat))
        perturbation.active = 0
        if self._target is not None:
            perturbation.active |= _TRANSLATE
            perturbation.refselpos = self._target
        if self._quat is not None:
            perturbation.active |= _ROTATE
            perturbation.refquat = compose(self._quat, model.body_iquat[self._body])

    def apply(self) -> None:
        """Adds the force and the torque of the spring for the next step to `xfrc_applied`."""
        simulation, force = self._simulation, self._force
        before = force.copy()
        # mjv_applyPerturbForce overwrites the force, but only that of its mode.
        force[:] = 0.0
        mujoco.mjv_applyPerturbForce(simulation.model, simulation.data, self._perturbation)
        force += before

    def place(self) -> None:
        """Sets the pose of a mocap body, or of the free body that the body belongs to; otherwise does nothing."""
        if not self._placeable:
            return
        simulation, perturbation, body = self._simulation, self._perturbation, self._body
        model, data = simulation.model, simulation.data
        simulation.mark_poses_outdated()
        simulation.kinematics()
        quat = data.xquat[body].copy() if self._quat is None else self._quat
        target = data.xpos[body] + rotate(data.xquat[body], self._local) if self._target is None else self._target
        # MuJoCo wants the pose of the inertial frame.
        perturbation.refpos = target + rotate(quat, model.body_ipos[body] - self._local)
        perturbation.refquat = compose(quat, model.body_iquat[body])
        mujoco.mjv_applyPerturbPose(model, data, perturbation, 1)
        simulation.mark_poses_outdated()

    def _mass(self) -> float:
        """Returns the mass that is felt at the point, averaged over all directions, as `mjv_initPerturb` does [kg]."""
        model, data = self._simulation.model, self._simulation.data
        point = data.xpos[self._body] + data.xmat[self._body].reshape(3, 3) @ self._local
        jacobian, accelerations = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, point, self._body)
        mujoco.mj_solveM(model, data, accelerations, jacobian)
        inverse = float((jacobian * accelerations).sum())
        return 3.0 / max(inverse, mujoco.mjMINVAL) if inverse else 1.0


def _tuple(values: Sequence[float] | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(map(float, values))
