"""Reads and sets poses and velocities of entities."""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError, UnknownName
from mjplug.physics.frames import compose, inverse, rotate
from mjplug.physics.simulation import Simulation
from mjplug.services.geometry import unit_quat_wxyz, vector
from mjplug.services.standard.entities import Entities, Entity
from mjplug.services.standard.replies import UNSUPPORTED, ResultError
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.geometry_msgs import Accel, Point, Pose, Quaternion, Twist, Vector3
from mjplug_schemas.simulation_interfaces import EntityState, SetEntityState
from mjplug_schemas.std_msgs import Header

Array = NDArray[np.float64]

WORLD = "world"
"""Name of the frame of all states."""

_XBODY = int(mujoco.mjtObj.mjOBJ_XBODY)


def states_of(simulation: Simulation, entities: Sequence[Entity]) -> list[EntityState]:
    """Returns poses, velocities and accelerations of canonical links in the world frame, at the present time.

    Accelerations are those at the beginning of the last step, as in MuJoCo's sensors.
    """
    model, data = simulation.model, simulation.data
    accelerations = _accelerations(model, data, entities)
    simulation.kinematics()
    if any(entity.free < 0 and model.body_dofnum[entity.body] for entity in entities):
        # Velocities of bodies belong to the state before the last step, until they are computed again.
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
    header = Header(stamp=Time.from_ns(simulation.time_ns), frame_id=WORLD)
    states = []
    for entity, acceleration in zip(entities, accelerations, strict=True):
        body = entity.body
        angular, linear = _velocity(model, data, entity)
        # Not validated, because there may be hundreds.
        states.append(
            EntityState.unchecked(
                header=header,
                pose=pose_of(data.xpos[body], data.xquat[body]),
                twist=Twist.unchecked(linear=_vector3(linear), angular=_vector3(angular)),
                acceleration=acceleration,
            )
        )
    return states


def pose_of(position: Array, quat_wxyz: Array) -> Pose:
    """Returns a pose as a message."""
    x, y, z = position.tolist()
    qw, qx, qy, qz = quat_wxyz.tolist()
    return Pose.unchecked(
        position=Point.unchecked(x=x, y=y, z=z), orientation=Quaternion.unchecked(x=qx, y=qy, z=qz, w=qw)
    )


def _velocity(model: mujoco.MjModel, data: mujoco.MjData, entity: Entity) -> tuple[Array, Array]:
    """Returns angular and linear velocity in world axes."""
    if entity.free >= 0:
        dof = int(model.jnt_dofadr[entity.free])
        return rotate(data.xquat[entity.body], data.qvel[dof + 3 : dof + 6]), data.qvel[dof : dof + 3]
    if not model.body_dofnum[entity.body]:
        return np.zeros(3), np.zeros(3)
    result = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, _XBODY, entity.body, result, 0)
    return result[:3], result[3:]


def _accelerations(model: mujoco.MjModel, data: mujoco.MjData, entities: Sequence[Entity]) -> list[Accel]:
    moving = [bool(model.body_dofnum[entity.body]) for entity in entities]
    if any(moving):
        mujoco.mj_rnePostConstraint(model, data)
    found, result, gravity = [], np.zeros(6), _gravity(model)
    for entity, moves in zip(entities, moving, strict=True):
        result[:] = 0.0
        if moves:
            mujoco.mj_objectAcceleration(model, data, _XBODY, entity.body, result, 0)
            # MuJoCo reports what an accelerometer measures, so a body at rest accelerates upwards.
            result[3:] += gravity
        found.append(Accel.unchecked(linear=_vector3(result[3:]), angular=_vector3(result[:3])))
    return found


def _gravity(model: mujoco.MjModel) -> Array:
    disabled = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return np.zeros(3) if disabled else np.array(model.opt.gravity)


def _vector3(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return Vector3.unchecked(x=x, y=y, z=z)


def set_state(simulation: Simulation, entities: Entities, request: SetEntityState.Request) -> str:
    """Checks and sets the state of an entity.

    Returns:
        Information for the client; empty if there is none.

    Raises:
        RequestError: The request is refused; nothing has changed.
    """
    entity = entities.get(request.entity)
    if not (request.set_pose or request.set_twist or request.set_acceleration):
        return "nothing was set, because set_pose, set_twist and set_acceleration are false"
    note = "accelerations are not set: they follow from forces" if request.set_acceleration else ""
    if not (request.set_pose or request.set_twist):
        return note
    position, quat = frame_in_world(simulation, entities, request.state.header.frame_id)
    pose = pose_in_world(request.state.pose, position, quat, INVALID_POSE) if request.set_pose else None
    twist = _twist(request.state.twist, quat) if request.set_twist else None
    _check_movable(entity, pose is not None, twist)
    model, data = simulation.model, simulation.data
    if pose is not None and entity.mocap >= 0:
        data.mocap_pos[entity.mocap], data.mocap_quat[entity.mocap] = pose
    elif pose is not None:
        begin = int(model.jnt_qposadr[entity.free])
        data.qpos[begin : begin + 3], data.qpos[begin + 3 : begin + 7] = pose
    if twist is not None and entity.free >= 0:
        linear, angular = twist
        dof, own = int(model.jnt_dofadr[entity.free]), int(model.jnt_qposadr[entity.free]) + 3
        data.qvel[dof : dof + 3] = linear
        data.qvel[dof + 3 : dof + 6] = rotate(inverse(data.qpos[own : own + 4]), angular)
    simulation.forward()
    return note


def _check_movable(entity: Entity, pose: bool, twist: tuple[Array, Array] | None) -> None:
    if entity.free >= 0:
        return
    moves = twist is not None and any(part.any() for part in twist)
    if entity.mocap >= 0:
        if moves:
            raise RequestError(f"entity {entity.name!r} follows its pose and cannot have a velocity")
        return
    if pose or moves:
        what = "its pose" if pose else "its velocity"
        raise RequestError(
            f"entity {entity.name!r} has no free joint, it is welded to the world or moved by its joints, so {what} "
            "cannot be set"
        )


def frame_in_world(simulation: Simulation, entities: Entities, name: str) -> tuple[Array, Array]:
    """Returns position [m] and orientation (w, x, y, z) of a frame in the world: `world`, an entity or a body.

    Raises:
        ResultError: There is no such frame.
    """
    name = name.removeprefix("/")
    if name in ("", WORLD):
        return np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))
    simulation.mark_poses_outdated()
    simulation.kinematics()
    known = entities.all()
    try:
        body = known[name].body if name in known else simulation.body_id(name)
    except UnknownName as error:
        raise ResultError(UNSUPPORTED, f"frame {name!r} is neither world nor an entity or body: {error}") from None
    return simulation.data.xpos[body].copy(), simulation.data.xquat[body].copy()


INVALID_POSE = SetEntityState.Response.INVALID_POSE


def pose_in_world(pose: Pose, position: Array, quat: Array, code: int) -> tuple[Array, Array]:
    """Returns position [m] and orientation (w, x, y, z) in the world of a pose in a frame.

    Args:
        pose: The pose.
        position: Position of the frame [m].
        quat: Orientation of the frame (w, x, y, z).
        code: The code of the error.

    Raises:
        ResultError: The pose is not valid.
    """
    try:
        own, turn = vector(pose.position, "pose.position"), unit_quat_wxyz(pose.orientation, "pose.orientation")
        placed = position + rotate(quat, own)
        if np.abs(placed).max() >= mujoco.mjMAXVAL:
            raise RequestError("the position in the world is too large")
    except RequestError as error:
        raise ResultError(code, str(error)) from None
    # A pose in the world keeps its bits.
    return placed, turn if quat[0] == 1.0 else compose(quat, turn)


def _twist(twist: Twist, quat: Array) -> tuple[Array, Array]:
    linear, angular = vector(twist.linear, "twist.linear"), vector(twist.angular, "twist.angular")
    if not math.isfinite(float(np.abs(linear).sum() + np.abs(angular).sum())):
        raise RequestError("the twist is not finite")
    return rotate(quat, linear), rotate(quat, angular)
