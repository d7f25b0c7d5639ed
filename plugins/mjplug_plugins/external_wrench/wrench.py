"""One wrench on one body: what a request must be, and what acts at each step."""

import math
from dataclasses import dataclass

import mujoco

from mjplug.errors import RequestError
from mjplug.plugin import Host
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg

Vec = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """A wrench in the body frame, from step `start` up to, not including, step `end`.

    Attributes:
        body: Body id.
        body_name: Body name, which is also its TF frame.
        point: Where the force acts, from the body frame's origin [m].
        force: Force [N].
        torque: Torque [N·m].
        torque_com: What force and torque add up to about the body's centre of mass [N·m].
        start: First step that feels it.
        end: First step that no longer does.
        duration: How long it lasts [s].
        ramp: Length of the linear ramp to zero at its end [s].
    """

    body: int
    body_name: str
    point: Vec
    force: Vec
    torque: Vec
    torque_com: Vec
    start: int
    end: int
    duration: float
    ramp: float

    def scale(self, elapsed: float) -> float:
        """Returns the factor of the ramp, 1 to 0, at `elapsed` [s] since the start."""
        remaining = self.duration - elapsed
        return 1.0 if remaining >= self.ramp else max(0.0, remaining / self.ramp)


def parse(host: Host, message: ExternalWrenchMsg) -> Wrench:
    """Checks a request and returns the wrench, starting at the current step.

    The application point, seen from the centre of mass, does not move in the body frame, so the moment of the force is
    constant there and is computed once: `torque + cross(point - ipos, force)`.

    Raises:
        RequestError: Unknown or immovable body, NaN or infinity, a negative time, or a ramp longer than the duration.
    """
    name = message.wrench.header.frame_id
    body = host.body_id(name)
    if host.model.body_weldid[body] == 0:
        what = "is the world" if body == 0 else "is fixed to the world"
        raise RequestError(f"body {name!r} {what}: a wrench cannot move it")
    force = _vector(message.wrench.wrench.force, "wrench.wrench.force")
    torque = _vector(message.wrench.wrench.torque, "wrench.wrench.torque")
    point = _vector(message.application_point, "application_point")
    duration = _nanoseconds(message.duration, "duration")
    ramp = _nanoseconds(message.ramp_down_duration, "ramp_down_duration")
    if ramp > duration:
        raise RequestError(f"ramp_down_duration is {ramp / 1e9:g} s, longer than the duration of {duration / 1e9:g} s")
    ipos = host.model.body_ipos[body].tolist()
    moment = _cross((point[0] - ipos[0], point[1] - ipos[1], point[2] - ipos[2]), force)
    return Wrench(
        body=body,
        body_name=name,
        point=point,
        force=force,
        torque=torque,
        torque_com=(torque[0] + moment[0], torque[1] + moment[1], torque[2] + moment[2]),
        start=host.step,
        end=host.step + max(1, host.steps_covering(duration)),
        duration=duration / 1e9,
        ramp=ramp / 1e9,
    )


def apply(data: mujoco.MjData, wrench: Wrench, scale: float) -> None:
    """Adds the wrench to `xfrc_applied`, turned by the body's current orientation (`xmat` must be current).

    Plain floats: for a handful of wrenches they are ten times faster than numpy on three elements.
    """
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = data.xmat[wrench.body].tolist()
    fx, fy, fz = wrench.force
    tx, ty, tz = wrench.torque_com
    data.xfrc_applied[wrench.body] += (
        scale * (r0 * fx + r1 * fy + r2 * fz),
        scale * (r3 * fx + r4 * fy + r5 * fz),
        scale * (r6 * fx + r7 * fy + r8 * fz),
        scale * (r0 * tx + r1 * ty + r2 * tz),
        scale * (r3 * tx + r4 * ty + r5 * tz),
        scale * (r6 * tx + r7 * ty + r8 * tz),
    )


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


def _cross(a: Vec, b: Vec) -> Vec:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
