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
    return messages_of(simulation, rows_of(simulation, entities))


def rows_of(simulation: Simulation, entities: Sequence[Entity]) -> NDArray[np.float64]:
    """Returns the same as numbers, one row for each entity, shape (n, 19), without making messages, which takes longer.

    A row contains position, orientation (x, y, z, w), linear and angular velocity, linear and angular acceleration.
    """
    model, data = simulation.model, simulation.data
    rows = np.zeros((len(entities), 19))
    _accelerations(model, data, entities, rows[:, 13:])
    simulation.kinematics()
    bodies = [entity.body for entity in entities]
    rows[:, :3] = data.xpos[bodies]
    rows[:, 3:7] = data.xquat[bodies][:, (1, 2, 3, 0)]
    free = [index for index, entity in enumerate(entities) if entity.free >= 0]
    if free:
        dofs = model.jnt_dofadr[[entities[index].free for index in free]]
        rows[free, 7:10] = data.qvel[dofs[:, None] + np.arange(3)]
        turns = data.xmat[[bodies[index] for index in free]].reshape(-1, 3, 3)
        # MuJoCo's angular velocity of a free body is in body axes.
        rows[free, 10:13] = np.einsum("nij,nj->ni", turns, data.qvel[dofs[:, None] + np.arange(3, 6)])
    jointed = [i for i, entity in enumerate(entities) if entity.free < 0 and model.body_dofnum[entity.body]]
    if jointed:
        # Velocities of bodies belong to the state before the last step, until they are computed again.
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        result = np.zeros(6)
        for index in jointed:
            mujoco.mj_objectVelocity(model, data, _XBODY, bodies[index], result, 0)
            rows[index, 7:10], rows[index, 10:13] = result[3:], result[:3]
    return rows


def messages_of(simulation: Simulation, rows: NDArray[np.float64]) -> list[EntityState]:
    """Returns rows of `rows_of` as messages with the present time."""
    return messages_at(Header(stamp=Time.from_ns(simulation.time_ns), frame_id=WORLD), rows)


def messages_at(header: Header, rows: NDArray[np.float64]) -> list[EntityState]:
    """Returns rows of `rows_of` as messages."""
    # Not validated, because there may be hundreds.
    return [
        EntityState.unchecked(
            header=header,
            pose=Pose.unchecked(
                position=Point.unchecked(x=row[0], y=row[1], z=row[2]),
                orientation=Quaternion.unchecked(x=row[3], y=row[4], z=row[5], w=row[6]),
            ),
            twist=Twist.unchecked(
                linear=Vector3.unchecked(x=row[7], y=row[8], z=row[9]),
                angular=Vector3.unchecked(x=row[10], y=row[11], z=row[12]),
            ),
            acceleration=Accel.unchecked(
                linear=Vector3.unchecked(x=row[13], y=row[14], z=row[15]),
                angular=Vector3.unchecked(x=row[16], y=row[17], z=row[18]),
            ),
        )
        for row in rows.tolist()
    ]


def pose_of(position: Array, quat_wxyz: Array) -> Pose:
    """Returns a pose as a message."""
    x, y, z = position.tolist()
    qw, qx, qy, qz = quat_wxyz.tolist()
    return Pose.unchecked(
        position=Point.unchecked(x=x, y=y, z=z), orientation=Quaternion.unchecked(x=qx, y=qy, z=qz, w=qw)
    )


def _accelerations(
    model: mujoco.MjModel, data: mujoco.MjData, entities: Sequence[Entity], rows: NDArray[np.float64]
) -> None:
    moving = [index for index, entity in enumerate(entities) if model.body_dofnum[entity.body]]
    if not moving:
        return
    mujoco.mj_rnePostConstraint(model, data)
    result = np.zeros(6)
    for index in moving:
        mujoco.mj_objectAcceleration(model, data, _XBODY, entities[index].body, result, 0)
        rows[index, :3], rows[index, 3:] = result[3:], result[:3]
    # MuJoCo reports what an accelerometer measures, so a body at rest accelerates upwards.
    rows[moving, :3] += _gravity(model)


def _gravity(model: mujoco.MjModel) -> Array:
    disabled = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return np.zeros(3) if disabled else np.array(model.opt.gravity)


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
