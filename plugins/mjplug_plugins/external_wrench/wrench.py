"""One wrench on one body: validation of a request, and the force at each step."""

import math
from dataclasses import dataclass, replace

import mujoco

from mjplug.plugin import Host, RequestError
from mjplug.plugin.bundled import float_view
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg

Vec = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """A wrench in the body frame, active from step `start` to step `end`, `end` excluded.

    Attributes:
        body: Body id.
        body_name: Body name.
        point: Application point of the force in the body frame [m].
        force: Force in the body frame [N].
        torque: Torque in the body frame [N·m].
        start: First step with the wrench.
        end: First step without it.
        duration: Duration of simulated time [s].
        ramp: Duration of the linear ramp to zero at the end [s].
        torque_com: Total torque of force and torque about the centre of mass, in the body frame [N·m].
        xmat: View of the body's nine elements of `xmat`.
        xfrc_applied: View of the body's six elements of `xfrc_applied`, force [N] and torque [N·m] in the world frame.
    """

    body: int
    body_name: str
    point: Vec
    force: Vec
    torque: Vec
    start: int
    end: int
    duration: float
    ramp: float
    torque_com: Vec
    xmat: "memoryview[float]"
    xfrc_applied: "memoryview[float]"

    def on_body(self, data: mujoco.MjData, body: int) -> "Wrench | None":
        """Returns the same wrench on the body with another id in another state; None if the id is negative."""
        if body < 0:
            return None
        xmat, xfrc_applied = float_view(data.xmat[body]), float_view(data.xfrc_applied[body])
        return replace(self, body=body, xmat=xmat, xfrc_applied=xfrc_applied)

    def scale(self, elapsed: float) -> float:
        """Returns the factor of the ramp, from 1 to 0, at `elapsed` [s] since the start."""
        remaining = self.duration - elapsed
        # Without a ramp, rounding can make `remaining` slightly negative at the last step.
        return 1.0 if remaining >= self.ramp or not self.ramp else max(0.0, remaining / self.ramp)

    def apply(self, elapsed: float) -> None:
        """Adds the wrench to `xfrc_applied`, rotated to the world frame; `xmat` must be current.

        Plain floats are used because numpy takes twice as long for three elements.
        """
        s = 1.0 if self.duration - elapsed >= self.ramp else self.scale(elapsed)
        r0, r1, r2, r3, r4, r5, r6, r7, r8 = self.xmat.tolist()
        fx, fy, fz = self.force
        tx, ty, tz = self.torque_com
        applied = self.xfrc_applied
        applied[0] += s * (r0 * fx + r1 * fy + r2 * fz)
        applied[1] += s * (r3 * fx + r4 * fy + r5 * fz)
        applied[2] += s * (r6 * fx + r7 * fy + r8 * fz)
        applied[3] += s * (r0 * tx + r1 * ty + r2 * tz)
        applied[4] += s * (r3 * tx + r4 * ty + r5 * tz)
        applied[5] += s * (r6 * tx + r7 * ty + r8 * tz)


def parse(host: Host, message: ExternalWrenchMsg) -> Wrench:
    """Checks a requested wrench and returns it, starting at the current step.

    The total torque about the centre of mass is constant in the body frame, so it is computed once:
    `torque + cross(point - ipos, force)`.

    Raises:
        RequestError: The body is unknown or cannot move, a number is not finite, a time is negative, or the ramp is
            longer than the duration.
    """
    name = message.wrench.header.frame_id
    force = _vector(message.wrench.wrench.force, "wrench.wrench.force")
    torque = _vector(message.wrench.wrench.torque, "wrench.wrench.torque")
    point = _vector(message.application_point, "application_point")
    duration = _nanoseconds(message.duration, "duration")
    ramp = _nanoseconds(message.ramp_down_duration, "ramp_down_duration")
    if ramp > duration:
        raise RequestError(f"ramp_down_duration ({ramp / 1e9:g} s) must not exceed duration ({duration / 1e9:g} s)")
    end = host.step + max(1, host.steps_covering(duration))
    return wrench_on(host, name, point, force, torque, (host.step, end), duration / 1e9, ramp / 1e9)


def wrench_on(
    host: Host, name: str, point: Vec, force: Vec, torque: Vec, steps: tuple[int, int], duration: float, ramp: float
) -> Wrench:
    """Returns the wrench on a body.

    Args:
        host: Provides model and state.
        name: The name of the body.
        point: Application point of the force in the body frame [m].
        force: Force in the body frame [N].
        torque: Torque in the body frame [N·m].
        steps: First step with the wrench, and first step without it.
        duration: Duration [s].
        ramp: Duration of the ramp [s].

    Raises:
        RequestError: The body is unknown or cannot move, or the torque is not finite.
    """
    model, data = host.model, host.data
    body = host.body_id(name)
    if not _movable(model, body):
        fixed = "is fixed to the world" if model.body_weldid[body] == 0 else "follows a mocap pose"
        raise RequestError(f"body {name!r} {'is the world' if body == 0 else fixed}, so a wrench cannot move it")
    torque_com = _moment(torque, point, float_view(model.body_ipos[body]), force)
    if not all(map(math.isfinite, torque_com)):
        raise RequestError("force and application_point are too large: their torque is not finite")
    return Wrench(
        body=body,
        body_name=name,
        point=point,
        force=force,
        torque=torque,
        start=steps[0],
        end=steps[1],
        duration=duration,
        ramp=ramp,
        torque_com=torque_com,
        xmat=float_view(data.xmat[body]),
        xfrc_applied=float_view(data.xfrc_applied[body]),
    )


def _moment(torque: Vec, point: Vec, com: "memoryview[float]", force: Vec) -> Vec:
    """Returns `torque + cross(point - com, force)` [N·m], with plain floats, because requests may be large."""
    x, y, z = point[0] - com[0], point[1] - com[1], point[2] - com[2]
    fx, fy, fz = force
    return torque[0] + (y * fz - z * fy), torque[1] + (z * fx - x * fz), torque[2] + (x * fy - y * fx)


def _movable(model: mujoco.MjModel, body: int) -> bool:
    """Returns whether any joint between the world and the body allows it to move."""
    while body:
        if model.body_dofnum[body]:
            return True
        body = int(model.body_parentid[body])
    return False


def _vector(value: Vector3 | Point, what: str) -> Vec:
    vector = (value.x, value.y, value.z)
    if not all(map(math.isfinite, vector)):
        raise RequestError(f"{what} is ({value.x:g}, {value.y:g}, {value.z:g}); every component must be finite")
    return vector


def _nanoseconds(value: Duration, what: str) -> int:
    nanoseconds = value.to_ns()
    if nanoseconds < 0:
        raise RequestError(f"{what} is {nanoseconds / 1e9:g} s; it must not be negative")
    return nanoseconds
