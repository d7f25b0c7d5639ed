"""Drives a floating base over the ground with commanded velocities."""

import math
from collections.abc import Mapping
from typing import Any

import mujoco
from pydantic import ConfigDict, Field

from mjplug.plugin import Host, Parameters, Plugin, PluginError, RequestError
from mjplug.plugin.bundled import float_view
from mjplug_plugins.free_body import free_bodies, free_body
from mjplug_schemas.geometry_msgs import Twist, TwistStamped

_NO_COMMAND = -1
_MAX_STEPS = 1 << 62
_MAX_VELOCITY = float(mujoco.mjMAXVAL)


class BaseVelocityParameters(Parameters):
    """Parameters of BaseVelocity."""

    # The plugin checks at the start that `body` is set, so that its error can list the bodies of the model.
    model_config = ConfigDict(json_schema_extra={"required": ["body"]})

    body: str = Field(default="", description="Body of the base, required; it needs a free joint.")
    cmd_vel_topic: str = Field(default="cmd_vel", description="Topic of the commands.")
    use_stamped_twist: bool = Field(
        default=False,
        description="Whether commands are TwistStamped instead of Twist; the header is not used.",
    )
    max_linear_velocity: float = Field(
        default=math.inf, gt=0, allow_inf_nan=True, description="Limit of the planar speed [m/s]."
    )
    max_yaw_rate: float = Field(
        default=math.inf, gt=0, allow_inf_nan=True, description="Limit of the yaw rate in both directions [rad/s]."
    )
    cmd_timeout: float = Field(
        default=0.5,
        gt=0,
        allow_inf_nan=True,
        description="Simulated time for which a command is followed after its reception [s].",
    )


class BaseVelocity(Plugin[BaseVelocityParameters]):
    """Sets the planar velocity of a floating base from `geometry_msgs/Twist` commands, at every step.

    The plugin sets the linear x and y velocity and the yaw rate of the body; physics determines height, roll and pitch.
    Without a command, or if the command is older than `cmd_timeout`, the velocity is zero. Commands that are not finite
    or too large are ignored.

    The command is rotated by the full orientation of the body, and its horizontal part is written. This gives the
    commanded speed along the ground on a slope too: the body's x and y axes are parallel to the slope, and contact adds
    the vertical part. A rotation by the heading alone would be too fast on a slope.
    """

    ignored = 0
    """Number of ignored commands."""

    def init(self, host: Host, parameters: BaseVelocityParameters) -> None:
        """Finds the base and holds its velocity at zero."""
        named = sorted(body.name for body in free_bodies(host.model) if body.name)
        if not parameters.body and named:
            raise PluginError(
                f"the parameter body is missing; bodies with a free joint: {', '.join(named)}; for example "
                f"--set plugins.{host.name}.body={named[0]}"
            )
        base = free_body(host, parameters.body)
        self._host = host
        self._topic = host.full_name(parameters.cmd_vel_topic)
        self._max_speed, self._max_yaw_rate = parameters.max_linear_velocity, parameters.max_yaw_rate
        self._timeout_steps = _last_step_within(host, parameters.cmd_timeout)
        self._quat_wxyz = float_view(host.data.qpos)[base.qpos + 3 : base.qpos + 7]
        self._hold = host.create_velocity_hold((base.dof, base.dof + 1, base.dof + 5))
        self._stop()
        if parameters.use_stamped_twist:
            host.create_subscription(TwistStamped, parameters.cmd_vel_topic, lambda m: self._handle(m.twist))
        else:
            host.create_subscription(Twist, parameters.cmd_vel_topic, self._handle)

    def update(self) -> None:
        """Sets the commanded velocity, rotated by the orientation at the beginning of this step."""
        if self._host.step > self._last_step:
            self._stop()
            return
        vx, vy, yaw_rate = self._command
        w, x, y, z = self._quat_wxyz.tolist()
        norm = w * w + x * x + y * y + z * z
        s = 2.0 / norm if norm else 0.0  # a zero quaternion is no rotation, as in MuJoCo
        sy, sz = s * y, s * z
        xy, zw, zz = x * sy, w * sz, z * sz
        self._hold.set(
            (1.0 - y * sy - zz) * vx + (xy - zw) * vy,
            (xy + zw) * vx + (1.0 - s * x * x - zz) * vy,
            yaw_rate,
        )

    def on_reset(self) -> None:
        """Discards the command; the base stands still until the next command."""
        self._stop()

    def save(self) -> dict[str, Any]:
        """Returns the command, and for how many steps it is still followed."""
        if self._last_step == _NO_COMMAND:
            return {"command": None, "steps": 0}
        return {"command": self._command, "steps": self._last_step - self._host.step}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets the command. The server restores the velocity hold, and calls `update` if there was a command."""
        if saved["command"] is None:
            self._last_step = _NO_COMMAND
            return
        vx, vy, yaw_rate = map(float, saved["command"])
        if not (math.hypot(vx, vy) < _MAX_VELOCITY and abs(yaw_rate) < _MAX_VELOCITY):
            raise RequestError(f"its command is {vx:g}, {vy:g}, {yaw_rate:g}")
        self._command = (vx, vy, yaw_rate)
        self._last_step = self._host.step + int(saved["steps"])

    def cleanup(self) -> None:
        """Logs how many commands were ignored, if more than the one that was reported."""
        if self.ignored > 1:
            self._host.logger.warning("%d commands on %s were ignored in all", self.ignored, self._topic)

    def _handle(self, twist: Twist) -> None:
        vx, vy, yaw_rate = twist.linear.x, twist.linear.y, twist.angular.z
        speed = math.hypot(vx, vy)
        finite = math.isfinite(speed) and math.isfinite(yaw_rate)
        # MuJoCo treats a larger velocity as a divergence, which would stop the simulation.
        if (
            not finite
            or min(speed, self._max_speed) >= _MAX_VELOCITY
            or min(abs(yaw_rate), self._max_yaw_rate) >= _MAX_VELOCITY
        ):
            self._ignore(vx, vy, yaw_rate)
            return
        if speed > self._max_speed:
            scale = self._max_speed / speed
            vx, vy = scale * vx, scale * vy
        yaw_rate = max(-self._max_yaw_rate, min(self._max_yaw_rate, yaw_rate))
        if not (vx or vy or yaw_rate):
            self._stop()
            return
        self._command = (vx, vy, yaw_rate)
        self._last_step = self._host.step + self._timeout_steps
        self._host.activate()

    def _stop(self) -> None:
        """Sets the velocity to zero; zero is the same in every frame, so no update is needed."""
        self._last_step = _NO_COMMAND
        self._hold.set(0.0, 0.0, 0.0)
        self._host.deactivate()

    def _ignore(self, vx: float, vy: float, yaw_rate: float) -> None:
        self.ignored += 1
        if self.ignored == 1:
            self._host.logger.warning(
                "a command on %s was ignored: linear.x is %g, linear.y is %g, angular.z is %g; all must be finite "
                "and below %g "
                "(further ones are only counted)",
                self._topic,
                vx,
                vy,
                yaw_rate,
                _MAX_VELOCITY,
            )


def _last_step_within(host: Host, duration: float) -> int:
    """Returns the largest number of steps that together last at most `duration` [s]."""
    nanoseconds = duration * 1e9
    # One nanosecond more than the duration takes one step more than fit into it.
    return host.steps_covering(round(nanoseconds) + 1) - 1 if nanoseconds < _MAX_STEPS else _MAX_STEPS
