"""The differential drive of a robot: which wheels drive it, their radius, and how they slip in turns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from mjplug.convert.actuators import Drive
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.report import Report
from mjplug.convert.robot import Joint, Robot
from mjplug.convert.rotations import numbers

_PARALLEL = 0.9
"""Smallest part of a wheel's axis along the y axis of the base."""

_MIN_SEPARATION = 1e-3
_OMNIDIRECTIONAL = ("mecanum", "omni", "swerve")

_SKID = 0.05
"""From this multiplier minus 1 on, the wheels slip sideways in turns."""

_TYRE_SOLREF, _TYRE_SOLIMP = (0.05, 0.5), (0.2, 0.2, 0.001, 0.5, 2.0)
"""Contact of a wheel that slips.

In MuJoCo's contacts, slip also pushes the surfaces apart. With the default values, wheels that slip faster than about
5 mm/s hop, and the base turns at a third of the rate that friction allows. This soft contact allows about 20 cm/s. It
sinks in by 1 or 2 mm, and creeps on a slope of 10 degrees at 2 to 3 cm/s.
"""


@dataclass(frozen=True, slots=True)
class DriveTrain:
    """Wheels on both sides of the base.

    Attributes:
        wheels: Their joints.
        radius: Their radius [m].
        multiplier: How many times faster the sides must turn against each other than wheels that do not slip.
    """

    wheels: tuple[str, ...]
    radius: float
    multiplier: float = 1.0

    @property
    def slips(self) -> bool:
        """Whether the wheels slip sideways in turns, as with four wheels on two axles."""
        return self.multiplier > 1.0


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
    axes, origin = data.xmat[base].reshape(3, 3), data.xpos[base]
    y_axis = axes[:, 1]
    along, sides, radii = [], [], []
    for wheel in driven:
        body = model.body(wheel.child).id
        radius = _radius(robot, model, data, wheel, lowest)
        sideways = abs(float(data.xmat[body].reshape(3, 3) @ wheel.axis @ y_axis))
        names = f"{robot.name} {wheel.name} {wheel.child}".lower()
        if sideways < _PARALLEL or radius is None or any(word in names for word in _OMNIDIRECTIONAL):
            report.add("warning", "wheels that are no differential drive; nothing follows cmd_vel", wheel.name)
            return None
        along.append(float((data.xpos[body] - origin) @ axes[:, 0]))
        sides.append(float((data.xpos[body] - origin) @ y_axis))
        radii.append(radius)
    if max(sides) - min(sides) < _MIN_SEPARATION or min(radii) <= 0.0:
        report.add("warning", "wheels that are no differential drive; nothing follows cmd_vel", driven[0].name)
        return None
    mean = round(sum(radii) / len(radii), 6)
    joints = tuple(wheel.name for wheel in driven)
    multiplier = skid_multiplier(along, sides)
    detail = f", wheel_separation_multiplier {multiplier:g}" if multiplier > 1.0 else ""
    report.add("guess", "differential drive for cmd_vel", ", ".join(joints), f"radius {mean:g} m{detail}")
    return DriveTrain(joints, mean, multiplier)


def skid_multiplier(along: Sequence[float], sides: Sequence[float]) -> float:
    """Returns the ratio of the turning rates without and with slip of the wheels; 1 for wheels on one axis.

    In a turn at a constant rate, the torque of the wheels' friction about the center is zero. If friction opposes the
    slip of each wheel, is equal in all directions, and each wheel carries the same load, the base turns at
    1 / (1 + mean(x²) / mean(y²)) of the rate without slip. For four wheels, this is 1 / (1 + (wheelbase / track)²).

    Args:
        along: x coordinates of the wheels in the base [m].
        sides: y coordinates of the wheels in the base [m].
    """
    x, y = np.array(along), np.array(sides)
    ratio = float(np.var(x)) / float(np.mean((y - (y.min() + y.max()) / 2.0) ** 2))
    return round(1.0 + ratio, 3) if ratio > _SKID else 1.0


def write_tyres(mjcf: Mjcf, robot: Robot, train: DriveTrain, report: Report) -> None:
    """Gives a soft contact to the wheels of a drive that slips, so that they do not hop."""
    if not train.slips:
        return
    for wheel in train.wheels:
        for link in robot.rigid_group(robot.joints[wheel].child):
            for geom in mjcf.collisions[link]:
                geom.set("solref", numbers(_TYRE_SOLREF))
                geom.set("solimp", numbers(_TYRE_SOLIMP))
                # Otherwise MuJoCo would use the mean of these values and those of the floor.
                geom.set("priority", "1")
    report.add("guess", "soft contact of wheels that slip sideways in turns", ", ".join(train.wheels))


def _radius(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, wheel: Joint, lowest: Mapping[str, float]
) -> float | None:
    """Returns the height of a wheel's axis above its lowest point; None if the wheel has no geometry [m]."""
    points = [lowest[name] for name in robot.rigid_group(wheel.child) if name in lowest]
    return float(data.xpos[model.body(wheel.child).id][2]) - min(points) if points else None
