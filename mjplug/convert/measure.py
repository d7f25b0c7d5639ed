"""Measures a compiled robot: lowest points, inertia and gravity torque at each joint, and links that touch."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.convert.kinematics import position_of
from mjplug.convert.robot import Robot
from mjplug.convert.rotations import Array

POSES = 100
"""Number of random poses."""

_ALWAYS = 0.95
"""Part of the poses in which two links touch that touch always."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Largest values over the home pose and the random poses.

    Attributes:
        inertia: Inertia at each joint while all other joints are locked [kg m², kg].
        gravity: Force or torque that holds each joint against gravity [N m, N].
        touching: Pairs of links that touch at home or always, and the part of the poses in which they do.
    """

    inertia: dict[str, float]
    gravity: dict[str, float]
    touching: dict[tuple[str, str], float]


def set_positions(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, positions: Mapping[str, float]) -> None:
    """Sets the positions of all joints with one coordinate; a free base keeps its pose."""
    for joint in robot.scalar_joints:
        data.qpos[model.joint(joint.name).qposadr[0]] = position_of(robot, joint, positions)


def random_poses(robot: Robot, count: int = POSES) -> Iterator[dict[str, float]]:
    """Yields positions within the limits; they are the same for each call."""
    generator = np.random.default_rng(0)
    for _ in range(count):
        pose = {}
        for joint in robot.scalar_joints:
            default = 0.5 if joint.type == "prismatic" else float(np.pi)
            low, high = joint.range or (-default, default)
            pose[joint.name] = float(generator.uniform(low, high))
        yield pose


def measure(robot: Robot, model: mujoco.MjModel, home: Mapping[str, float], contacts: bool) -> Measured:
    """Returns what the actuators and the contacts of a robot depend on.

    Args:
        robot: The robot.
        model: Its model, without actuators and without a floor.
        home: The home pose.
        contacts: Whether touching links are wanted, which takes most of the time.
    """
    data = mujoco.MjData(model)
    joints = [(joint.name, int(model.joint(joint.name).dofadr[0])) for joint in robot.scalar_joints]
    inertia, gravity = (dict.fromkeys((name for name, _ in joints), 0.0) for _ in range(2))
    touching: dict[tuple[str, str], int] = {}
    at_home: set[tuple[str, str]] = set()
    unit, column = np.zeros(model.nv), np.zeros(model.nv)
    if not contacts:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for index, pose in enumerate([home, *random_poses(robot)]):
        set_positions(robot, model, data, pose)
        mujoco.mj_forward(model, data)
        for name, dof in joints:
            unit[:] = 0.0
            unit[dof] = 1.0
            mujoco.mj_mulM(model, data, column, unit)
            inertia[name] = max(inertia[name], float(column[dof]))
            gravity[name] = max(gravity[name], abs(float(data.qfrc_bias[dof])))
        pairs = set(_touching(model, data))
        at_home = pairs if index == 0 else at_home
        for pair in pairs:
            touching[pair] = touching.get(pair, 0) + 1
    if not contacts:
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    count = POSES + 1
    kept = {pair: number / count for pair, number in touching.items() if pair in at_home or number >= _ALWAYS * count}
    return Measured(inertia, gravity, dict(sorted(kept.items())))


def lowest_points(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """Returns the lowest point of each link with geometry [m].

    It is that of the collision geometry, or of the visual geometry if the whole robot has no collision geometry.
    """
    colliding = [geom for geom in range(model.ngeom) if model.geom_contype[geom] or model.geom_conaffinity[geom]]
    result: dict[str, float] = {}
    for geom in colliding or range(model.ngeom):
        name = model.body(int(model.geom_bodyid[geom])).name
        name = robot.root if name == "world" else name
        result[name] = min(result.get(name, np.inf), lowest_of(model, data, geom))
    return result


def lowest_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Returns the lowest point of a geom [m]."""
    position, axes = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    down, size = axes[2], model.geom_size[geom]
    kind = int(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        start = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(float)
        return float(position[2] + (vertices @ down).min())
    return float(position[2] - _reach(kind, size, down))


def _reach(kind: int, size: NDArray[np.float64], down: Sequence[float] | Array) -> float:
    """Returns how far a simple shape extends downwards from its center [m]."""
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return float(size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return float(size[0] + size[1] * abs(down[2]))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return float(size[0] * np.hypot(down[0], down[1]) + size[1] * abs(down[2]))
    return float(np.abs(down) @ size)


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[str, str]]:
    for index in range(data.ncon):
        contact = data.contact[index]
        if contact.dist < 0.0:
            first, second = (model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom)
            yield (first, second) if first < second else (second, first)
