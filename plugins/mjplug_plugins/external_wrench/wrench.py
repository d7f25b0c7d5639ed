"""One wrench on one body: what a request must be, and what acts at each step."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError
from mjplug.plugin import Host
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg

Vec = tuple[float, float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """A wrench in the body frame, from step `start` up to, not including, step `end`.

    Attributes:
        body_name: Body name, which is also its TF frame.
        point: Where the force acts, from the body frame's origin [m].
        force: Force [N].
        torque: Torque [N·m].
        start: First step that feels it.
        end: First step that no longer does.
        duration: How long it lasts [s].
        ramp: Length of the linear ramp to zero at its end [s].
        at_com_b: Force [N] and torque about the centre of mass [N·m], body frame, shape (2, 3).
        rotation: View of the body's `xmat`, transposed, shape (3, 3).
        applied: View of the body's `xfrc_applied`, shape (2, 3).
        scratch: Room for the product, shape (2, 3).
    """

    body_name: str
    point: Vec
    force: Vec
    torque: Vec
    start: int
    end: int
    duration: float
    ramp: float
    at_com_b: Array
    rotation: Array
    applied: Array
    scratch: Array

    def scale(self, elapsed: float) -> float:
        """Returns the factor of the ramp, 1 to 0, at `elapsed` [s] since the start."""
        remaining = self.duration - elapsed
        return 1.0 if remaining >= self.ramp else max(0.0, remaining / self.ramp)

    def apply(self, elapsed: float) -> None:
        """Adds the wrench to `xfrc_applied`, turned by the body's orientation; `xmat` must be current."""
        np.dot(self.at_com_b, self.rotation, self.scratch)
        if self.duration - elapsed < self.ramp:
            np.multiply(self.scratch, self.scale(elapsed), self.scratch)
        np.add(self.applied, self.scratch, self.applied)


def parse(host: Host, message: ExternalWrenchMsg) -> Wrench:
    """Checks a request and returns the wrench, starting at the current step.

    The application point, seen from the centre of mass, does not move in the body frame, so the moment of the force is
    constant there and is computed once: `torque + cross(point - ipos, force)`.

    Raises:
        RequestError: Unknown or immovable body, NaN or infinity, a negative time, or a ramp longer than the duration.
    """
    model, data = host.model, host.data
    name = message.wrench.header.frame_id
    body = host.body_id(name)
    if model.body_weldid[body] == 0:
        what = "is the world" if body == 0 else "is fixed to the world"
        raise RequestError(f"body {name!r} {what}: a wrench cannot move it")
    force = _vector(message.wrench.wrench.force, "wrench.wrench.force")
    torque = _vector(message.wrench.wrench.torque, "wrench.wrench.torque")
    point = _vector(message.application_point, "application_point")
    duration = _nanoseconds(message.duration, "duration")
    ramp = _nanoseconds(message.ramp_down_duration, "ramp_down_duration")
    if ramp > duration:
        raise RequestError(f"ramp_down_duration is {ramp / 1e9:g} s, longer than the duration of {duration / 1e9:g} s")
    arm = np.subtract(point, model.body_ipos[body])
    return Wrench(
        body_name=name,
        point=point,
        force=force,
        torque=torque,
        start=host.step,
        end=host.step + max(1, host.steps_covering(duration)),
        duration=duration / 1e9,
        ramp=ramp / 1e9,
        at_com_b=np.array((force, np.add(torque, np.cross(arm, force)))),
        rotation=data.xmat[body].reshape(3, 3).T,
        applied=data.xfrc_applied[body].reshape(2, 3),
        scratch=np.empty((2, 3)),
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

