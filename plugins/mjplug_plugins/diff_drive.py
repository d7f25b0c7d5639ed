"""Drives a base with wheels on both sides: differential drive, and skid steering with more than two wheels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from pydantic import Field

from mjplug.plugin import Host, Parameters, Plugin, PluginError
from mjplug.plugin.bundled import ActuatorLaw, Drives, actuator_law
from mjplug_schemas.geometry_msgs import Twist, TwistStamped

_MIN_SEPARATION = 1e-3
_MAX_CONTROL = 0.99 * mujoco.mjMAXVAL
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)


class DiffDriveParameters(Parameters):
    """Parameters of DiffDrive."""

    wheels: tuple[str, ...] = Field(
        default=(), strict=False, description="Joints of the wheels; empty: all hinges with a velocity servo."
    )
    wheel_radius: float = Field(default=0.0, ge=0, description="Radius of the wheels, required [m].")
    wheel_separation: float = Field(
        default=0.0, ge=0, description="Distance between the left and the right wheels [m]; 0: from the model."
    )
    wheel_separation_multiplier: float = Field(
        default=1.0,
        gt=0,
        description="Factor of the separation, above 1 if the wheels slip sideways in turns: about 1 + (wheelbase / "
        "separation)² for four wheels.",
    )
    body: str = Field(default="", description="Body of the base; empty: the parent of the first wheel.")
    cmd_vel_topic: str = Field(default="{ns}/cmd_vel", description="Topic of the commands.")
    use_stamped_twist: bool = Field(
        default=False, description="Whether commands are TwistStamped instead of Twist; the header is not used."
    )
    cmd_timeout: float = Field(
        default=0.5, gt=0, description="Simulated time for which a command is followed after its reception [s]."
    )


@dataclass(frozen=True, slots=True)
class _Wheel:
    """A wheel.

    Attributes:
        actuator: Its velocity servo.
        law: The law of the servo.
        forward: 1 if a positive velocity drives forward, -1 otherwise.
        left: Distance to the left of the base's center [m].
    """

    actuator: int
    law: ActuatorLaw
    forward: float
    left: float


class DiffDrive(Plugin[DiffDriveParameters]):
    """Drives wheels with velocity servos from `geometry_msgs/Twist` commands; `linear.x` and `angular.z` are used.

    The wheels turn as they would without slip, and friction moves the base. Without a command, or if the command is
    older than `cmd_timeout`, the wheels stand still. Commands that are not finite, or
    that give a wheel a control above 9.9e9, are ignored.
    """

    ignored = 0
    """Number of ignored commands."""

    def init(self, host: Host, parameters: DiffDriveParameters) -> None:
        """Finds the wheels and their servos."""
        self._host, self._wheels, self._last_step = host, [], -1
        self._timeout_steps = host.steps_covering(round(parameters.cmd_timeout * 1e9))
        servos = _servos(host.model)
        for name in parameters.wheels:
            if name not in servos:
                known = ", ".join(sorted(servos)) or "none"
                raise PluginError(f"{name!r} is no hinge with a velocity servo; hinges with one: {known}")
        joints = list(parameters.wheels or servos)
        if not joints:
            host.logger.warning("no hinge of the model has a velocity servo: nothing can be driven")
        elif not parameters.wheel_radius:
            raise PluginError("the parameter wheel_radius is missing; give the radius of the wheels [m]")
        self._radius = parameters.wheel_radius
        self._wheels = _wheels(host, joints, servos, parameters.body) if joints else []
        half = parameters.wheel_separation / 2.0
        factor = parameters.wheel_separation_multiplier
        self._lever = [factor * (math.copysign(half, wheel.left) if half else wheel.left) for wheel in self._wheels]
        if parameters.use_stamped_twist:
            host.create_subscription(TwistStamped, parameters.cmd_vel_topic, lambda m: self._handle(m.twist))
        else:
            host.create_subscription(Twist, parameters.cmd_vel_topic, self._handle)

    def update(self) -> None:
        """Stops the wheels when the command is too old."""
        if self._host.step > self._last_step:
            self._stop()

    def on_reset(self) -> None:
        """Discards the command."""
        self._stop()

    def save(self) -> dict[str, int]:
        """Returns for how many steps the command is still followed; the controls are part of MuJoCo's state."""
        return {"steps": self._last_step - self._host.step}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets for how many steps the command is still followed."""
        self._last_step = self._host.step + int(saved["steps"])

    def _handle(self, twist: Twist) -> None:
        forward, yaw_rate = twist.linear.x, twist.angular.z
        controls = self._controls(forward, yaw_rate)
        # With a larger control of one actuator, MuJoCo sets those of all to zero.
        if not all(abs(control) <= _MAX_CONTROL for control in controls):
            self.ignored += 1
            if self.ignored == 1:
                self._host.logger.warning(
                    "a command was ignored: linear.x is %g, angular.z is %g; both must be finite, and the controls of "
                    "the wheels below %g (further ones are only counted)",
                    forward,
                    yaw_rate,
                    _MAX_CONTROL,
                )
            return
        self._apply(controls)
        self._last_step = self._host.step + self._timeout_steps
        self._host.activate()

    def _controls(self, forward: float, yaw_rate: float) -> list[float]:
        """Returns the control of each wheel, before the limits of its servo."""
        return [
            wheel.law.control(wheel.forward * (forward - yaw_rate * lever) / self._radius)
            for wheel, lever in zip(self._wheels, self._lever, strict=True)
        ]

    def _stop(self) -> None:
        self._apply(self._controls(0.0, 0.0))
        self._host.deactivate()

    def _apply(self, controls: list[float]) -> None:
        ctrl, limits = self._host.data.ctrl, self._host.model.actuator_ctrlrange
        for wheel, control in zip(self._wheels, controls, strict=True):
            limited = control
            if self._host.model.actuator_ctrllimited[wheel.actuator]:
                low, high = limits[wheel.actuator]
                limited = min(max(control, low), high)
            ctrl[wheel.actuator] = limited


def _servos(model: mujoco.MjModel) -> dict[str, int]:
    """Returns the velocity servos of hinges, by the names of the joints."""
    found = {}
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] != _JOINT:
            continue
        joint = int(model.actuator_trnid[actuator, 0])
        hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        if hinge and actuator_law(model, actuator).drives == Drives.VELOCITY:
            found[model.joint(joint).name] = actuator
    return found


def _wheels(host: Host, joints: list[str], servos: dict[str, int], body: str) -> list[_Wheel]:
    """Returns the wheels with their places relative to the base.

    Raises:
        PluginError: A wheel's axis is not parallel to the y axis of the base, or all wheels are on one side.
    """
    model, data = host.model, host.data
    host.kinematics()
    base = host.body_id(body) if body else int(model.body_parentid[model.joint(joints[0]).bodyid[0]])
    axes, origin = data.xmat[base].reshape(3, 3), data.xpos[base]
    anchors, sides = [], []
    for name in joints:
        joint = model.joint(name)
        wheel = int(joint.bodyid[0])
        turned = data.xmat[wheel].reshape(3, 3)
        side = float((turned @ joint.axis) @ axes[:, 1])
        if abs(side) < 0.9:
            raise PluginError(
                f"the axis of wheel {name!r} is not parallel to the y axis of body {model.body(base).name!r}"
            )
        sides.append(math.copysign(1.0, side))
        anchors.append(float((data.xpos[wheel] + turned @ joint.pos - origin) @ axes[:, 1]))
    # The base's frame may be beside its middle.
    middle = (min(anchors) + max(anchors)) / 2.0
    if max(anchors) - min(anchors) < _MIN_SEPARATION:
        raise PluginError(f"the wheels are not on both sides of body {model.body(base).name!r}")
    return [
        _Wheel(servos[name], actuator_law(model, servos[name]), side, float(np.round(anchor - middle, 9)))
        for name, side, anchor in zip(joints, sides, anchors, strict=True)
    ]
