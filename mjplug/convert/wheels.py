"""The differential drive of a robot: which wheels drive it, and their radius."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco

from mjplug.convert.actuators import Drive
from mjplug.convert.report import Report
from mjplug.convert.robot import Joint, Robot

_PARALLEL = 0.9
"""Smallest part of a wheel's axis along the y axis of the base."""

_MIN_SEPARATION = 1e-3
_OMNIDIRECTIONAL = ("mecanum", "omni", "swerve")


@dataclass(frozen=True, slots=True)
class DriveTrain:
    """Wheels on both sides of the base.

    Attributes:
        wheels: Their joints.
        radius: Their radius [m].
    """

    wheels: tuple[str, ...]
    radius: float


def largest_radius(
    robot: Robot,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    wheels: Sequence[Joint],
    lowest: Mapping[str, float],
) -> float:
    """Returns the radius of the largest wheel; 0 without wheels that have a geometry [m]."""
    found = (_radius(robot, model, data, wheel, lowest) for wheel in wheels)
    return max((radius for radius in found if radius is not None), default=0.0)


def drive_train(
    robot: Robot,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    wheels: Sequence[Joint],
    drives: Sequence[Drive],
    lowest: Mapping[str, float],
    report: Report,
) -> DriveTrain | None:
    """Returns the differential drive; None if there is none, or if a drive with such wheels moves differently.

    Args:
        robot: The robot.
        model: Its model.
        data: The home pose, with its poses computed.
        wheels: Its wheels.
        drives: The actuators of all joints.
        lowest: The lowest point of each link with geometry [m].
        report: The report.
    """
    servos = {drive.joint for drive in drives if drive.kind == "velocity"}
    driven = [wheel for wheel in wheels if wheel.name in servos]
    if len(driven) < 2:
        return None
    base = model.body(robot.root).id
    y_axis, origin = data.xmat[base].reshape(3, 3)[:, 1], data.xpos[base]
    sides, radii = [], []
    for wheel in driven:
        body = model.body(wheel.child).id
        radius = _radius(robot, model, data, wheel, lowest)
        sideways = abs(float(data.xmat[body].reshape(3, 3) @ wheel.axis @ y_axis))
        names = f"{robot.name} {wheel.name} {wheel.child}".lower()
        if sideways < _PARALLEL or radius is None or any(word in names for word in _OMNIDIRECTIONAL):
            report.add("warning", "wheels that are no differential drive; nothing follows cmd_vel", wheel.name)
            return None
        sides.append(float((data.xpos[body] - origin) @ y_axis))
        radii.append(radius)
    if max(sides) - min(sides) < _MIN_SEPARATION or min(radii) <= 0.0:
        report.add("warning", "wheels that are no differential drive; nothing follows cmd_vel", driven[0].name)
        return None
    mean = round(sum(radii) / len(radii), 6)
    joints = tuple(wheel.name for wheel in driven)
    report.add("guess", "differential drive for cmd_vel", ", ".join(joints), f"radius {mean:g} m")
    return DriveTrain(joints, mean)


def _radius(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, wheel: Joint, lowest: Mapping[str, float]
) -> float | None:
    """Returns the height of a wheel's axis above its lowest point; None if the wheel has no geometry [m]."""
    points = [lowest[name] for name in robot.rigid_group(wheel.child) if name in lowest]
    return float(data.xpos[model.body(wheel.child).id][2]) - min(points) if points else None
