"""Drives a floating base over the ground with the velocity that a command topic asks for."""

import math

import mujoco
from pydantic import Field

from mjplug.plugin import Host, Parameters, Plugin
from mjplug.plugin.bundled import float_view
from mjplug_plugins.free_body import free_body
from mjplug_schemas.geometry_msgs import Twist, TwistStamped

_NEVER = -1
_ALWAYS = 1 << 62
_LARGEST = float(mujoco.mjMAXVAL)


class BaseVelocityParameters(Parameters):
    """Parameters of BaseVelocity."""

    body: str = Field(description="Body of the base; it needs a free joint.")
    cmd_vel_topic: str = Field(default="cmd_vel", description="Topic of the commands.")
    use_stamped_twist: bool = Field(
        default=False,
        description="Whether commands are TwistStamped instead of Twist; the header is not used.",
    )
    max_linear_velocity: float = Field(
        default=math.inf, gt=0, allow_inf_nan=True, description="Limit of the planar speed [m/s]."
    )
    max_yaw_rate: float = Field(
        default=math.inf, gt=0, allow_inf_nan=True, description="Limit of the yaw rate, both ways [rad/s]."
    )
    cmd_timeout: float = Field(
        default=0.5,
        gt=0,
        allow_inf_nan=True,
        description="How long a command holds, in simulated time from its reception [s].",
    )


class BaseVelocity(Plugin[BaseVelocityParameters]):
    """Sets the planar velocity of a floating base as `geometry_msgs/Twist` commands say, at every step.

    Driven are the body's linear x and y and its yaw rate; height, roll and pitch are left to physics. A command that is
    older than `cmd_timeout`, or none at all, means zero. Commands that no physics could follow are ignored.

    The command is turned by the body's whole orientation and its horizontal part is written. On a slope this is what
    keeps the speed along the ground: the body's x and y axes lie in the slope, contact adds the vertical part of the
    motion, and together they are the command. Turning it by the heading alone would be too fast there.
    """

    ignored = 0
    """Commands that were ignored so far."""

    def init(self, host: Host, parameters: BaseVelocityParameters) -> None:
        """Looks the base up and starts to hold it."""
        base = free_body(host, parameters.body)
        self._host = host
        self._topic = host.full_name(parameters.cmd_vel_topic)
        self._max_speed, self._max_yaw_rate = parameters.max_linear_velocity, parameters.max_yaw_rate
        self._timeout_steps = _last_step_within(host, parameters.cmd_timeout)
        self._quat_wxyz = float_view(host.data.qpos)[base.qpos + 3 : base.qpos + 7]
        self._hold = host.create_velocity_hold((base.dof, base.dof + 1, base.dof + 5))
        self._stop()
        if parameters.use_stamped_twist:
            host.create_subscription(TwistStamped, parameters.cmd_vel_topic, lambda m: self._take(m.twist))
        else:
            host.create_subscription(Twist, parameters.cmd_vel_topic, self._take)

    def update(self) -> None:
        """Sets the commanded velocity, turned by the orientation at the beginning of this very step."""
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
        """Forgets the command: the base stands until the next one."""
        self._stop()

    def cleanup(self) -> None:
        """Says how many commands were ignored, if more than the one that was reported."""
        if self.ignored > 1:
            self._host.logger.warning("%d commands on %s were ignored in all", self.ignored, self._topic)

    def _take(self, twist: Twist) -> None:
        vx, vy, yaw_rate = twist.linear.x, twist.linear.y, twist.angular.z
        speed = math.hypot(vx, vy)
        finite = math.isfinite(speed) and math.isfinite(yaw_rate)
        # MuJoCo takes a velocity beyond for a divergence, and the whole world would stop.
        if not finite or min(speed, self._max_speed) >= _LARGEST or min(abs(yaw_rate), self._max_yaw_rate) >= _LARGEST:
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
        """Holds the base where it is; zero is zero in every frame, so that no update is needed."""
        self._last_step = _NEVER
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
                _LARGEST,
            )


def _last_step_within(host: Host, duration: float) -> int:
    """Returns the largest number of steps that together last at most `duration` [s]."""
    nanoseconds = duration * 1e9
    # One nanosecond more than the duration takes one step more than fit into it.
    return host.steps_covering(round(nanoseconds) + 1) - 1 if nanoseconds < _ALWAYS else _ALWAYS
