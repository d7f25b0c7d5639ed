"""Publishes the pose and velocity of a robot base, as the simulation computes them: without noise, drift or delay."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mjplug.plugin import CdrFrame, Host, Parameters, Plugin, PluginError, QoS, RequestError
from mjplug_plugins.free_body import free_bodies
from mjplug_schemas.geometry_msgs import PoseWithCovariance, TransformStamped, TwistWithCovariance
from mjplug_schemas.nav_msgs import Odometry
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.tf2_msgs import TFMessage

Array = NDArray[np.float64]

Variance = Annotated[float, Field(ge=0)]
Diagonal = Annotated[tuple[Variance, Variance, Variance, Variance, Variance, Variance], Field(strict=False)]
"""Diagonal of a covariance matrix. It is not strict, because a list in YAML is not a tuple."""

_WXYZ = "wxyz"
"""MuJoCo's order of a quaternion. The message has the order x, y, z, w, so the four numbers are written by name."""


_ORIGIN = ("position", "axes", "inverse_rotation")
"""Names of the arrays of the origin in a saved state."""


class OdometryParameters(Parameters):
    """Parameters of OdometryPublisher."""

    body: str = Field(default="", description="Body of the base; empty: the only body with a free joint.")
    topic: str = Field(default="{ns}/odom", description="Topic name.")
    rate: float = Field(default=50.0, gt=0, description="Messages per second of simulated time [Hz].")
    frame_id: str = Field(default="odom", description="Frame of the pose.")
    child_frame_id: str = Field(
        default="", description="Frame of the base and of the twist; empty: the name of the body."
    )
    origin: Literal["world", "start"] = Field(
        default="world",
        description="Origin of the pose: the world frame, or the pose of the base at the start and after each reset "
        "(`start`).",
    )
    publish_tf: bool = Field(default=False, description="Whether the pose is also published on `tf_topic`.")
    tf_topic: str = Field(default="{ns}/tf", description="Topic of the transform.")
    pose_covariance: Diagonal = Field(
        default=(0.0,) * 6, description="Variances of x, y, z and of the rotations about x, y, z [m², rad²]."
    )
    twist_covariance: Diagonal = Field(
        default=(0.0,) * 6, description="Variances of the velocities along and about x, y, z [(m/s)², (rad/s)²]."
    )


class OdometryPublisher(Plugin[OdometryParameters]):
    """Publishes pose and velocity of a base as `nav_msgs/Odometry`; the velocities are in the frame of the base.

    The base is any body, with a free joint or on slides and hinges. Pose and velocity belong to the
    instant of the stamp.
    """

    def init(self, host: Host, parameters: OdometryParameters) -> None:
        """Prepares the message and starts the timer."""
        self._host = host
        name = parameters.body or _only_free_body(host)
        self._base = _Base(host, host.body_id(name))
        self._from_start = parameters.origin == "start"
        # The origin at the start.
        self.on_reset()
        child = host.frame_id(parameters.child_frame_id or name)
        header = Header(frame_id=host.frame_id(parameters.frame_id))
        self._message = CdrFrame(
            Odometry(
                header=header,
                child_frame_id=child,
                pose=PoseWithCovariance(covariance=_on_diagonal(parameters.pose_covariance)),
                twist=TwistWithCovariance(covariance=_on_diagonal(parameters.twist_covariance)),
            )
        )
        self._position = self._message.view("pose.pose.position")
        self._quat = self._message.slots(f"pose.pose.orientation.{part}" for part in _WXYZ)
        self._linear, self._angular = (self._message.view(f"twist.twist.{part}") for part in ("linear", "angular"))
        self._transform = CdrFrame(TFMessage(transforms=[TransformStamped(header=header, child_frame_id=child)]))
        self._translation = self._transform.view("transforms[0].transform.translation")
        self._rotation = self._transform.slots(f"transforms[0].transform.rotation.{part}" for part in _WXYZ)
        self._publisher = host.create_publisher(Odometry, parameters.topic, sample=self._odometry)
        self._tf = None
        if parameters.publish_tf:
            self._tf = host.create_publisher(
                TFMessage, parameters.tf_topic, QoS(depth=100), sample=self._moved_transform
            )
        publishers = [publisher for publisher in (self._publisher, self._tf) if publisher is not None]
        # The timer sleeps while no publisher has a subscriber.
        host.create_timer(1.0 / parameters.rate, self._publish, while_matched=publishers)

    def on_reset(self) -> None:
        """Sets the origin to the new pose, if `origin` is `start`."""
        if self._from_start:
            self._base.set_origin()

    def save(self) -> dict[str, Any]:
        """Returns the origin."""
        origin = self._base.origin
        return {} if origin is None else dict(zip(_ORIGIN, origin, strict=True))

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets the origin."""
        if self._from_start != bool(saved):
            raise RequestError("`origin` was another one")
        if self._from_start:
            self._base.origin = _origin(saved)

    def _publish(self) -> None:
        self._base.read()
        if self._publisher.matched:
            self._publisher.publish_frame(self._write_odometry())
        if self._tf is not None and self._tf.matched:
            self._tf.publish_frame(self._write_transform())

    def _odometry(self) -> CdrFrame:
        self._base.read()
        return self._write_odometry()

    def _moved_transform(self) -> CdrFrame:
        self._base.read()
        return self._write_transform()

    def _write_odometry(self) -> CdrFrame:
        base = self._base
        self._position[:], self._linear[:], self._angular[:] = base.position, base.linear, base.angular
        self._quat.write(base.quat_wxyz)
        self._message.set_stamp("header.stamp", self._host.time_ns)
        return self._message

    def _write_transform(self) -> CdrFrame:
        self._translation[:] = self._base.position
        self._rotation.write(self._base.quat_wxyz)
        self._transform.set_stamp("transforms[0].header.stamp", self._host.time_ns)
        return self._transform


class _Base:
    """Computes pose and velocity of a body.

    Attributes:
        origin: Position, axes and inverse rotation of the origin, shapes (3,), (3, 3) and (4,); None: the world.
        position: Position relative to the origin, in the axes of the origin, shape (3,) [m].
        quat_wxyz: Orientation relative to the origin (w, x, y, z), shape (4,).
        linear: Velocity of the body frame's origin, in body axes, shape (3,) [m/s].
        angular: Angular velocity in body axes, shape (3,) [rad/s].
    """

    def __init__(self, host: Host, body: int) -> None:
        data = host.data
        self._host, self._body = host, body
        # Views of the state, which always contain the present values.
        self._xpos, self._xquat = data.xpos[body], data.xquat[body]
        self._xmat = data.xmat[body].reshape(3, 3)
        free = {base.body: base.dof for base in free_bodies(host.model)}
        self._qvel = data.qvel[free[body] : free[body] + 6] if body in free else None
        self._jacobians = np.zeros((2, 3, host.model.nv))
        self.origin: tuple[Array, Array, Array] | None = None
        self.position, self.quat_wxyz = np.zeros(3), np.zeros(4)
        self.linear, self.angular = np.zeros(3), np.zeros(3)

    def set_origin(self) -> None:
        """Sets the origin to the current pose."""
        self._host.kinematics()
        self.origin = self._xpos.copy(), self._xmat.copy(), self._xquat * (1.0, -1.0, -1.0, -1.0)

    def read(self) -> None:
        """Computes the attributes for the current state."""
        self._host.kinematics()
        if self.origin is None:
            self.position, self.quat_wxyz = self._xpos, self._xquat
        else:
            begin, axes, inverse = self.origin
            self.position = (self._xpos - begin) @ axes
            mujoco.mju_mulQuat(self.quat_wxyz, inverse, self._xquat)
        if self._qvel is not None:
            # The linear velocity of a free joint is in world axes, the angular velocity in body axes.
            self.linear, self.angular = self._qvel[:3] @ self._xmat, self._qvel[3:]
        else:
            model, data = self._host.model, self._host.data
            # The Jacobian is computed from the poses and from the results of mj_comPos.
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacBody(model, data, self._jacobians[0], self._jacobians[1], self._body)
            self.linear, self.angular = self._jacobians @ data.qvel @ self._xmat


def _origin(saved: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    origin = tuple(np.array(saved[name], float) for name in _ORIGIN)
    if [array.shape for array in origin] != [(3,), (3, 3), (4,)]:
        raise RequestError("the origin has another size")
    return origin[0], origin[1], origin[2]


def _only_free_body(host: Host) -> str:
    """Returns the name of the only body with a free joint.

    Raises:
        PluginError: There is no such body, there are several, or it has no name.
    """
    named = [body.name for body in free_bodies(host.model)]
    if len(named) == 1 and named[0]:
        return named[0]
    if not named:
        raise PluginError("the model has no body with a free joint; set `body` to the body to publish")
    names = ", ".join(name or "a body without a name" for name in named)
    raise PluginError(f"set `body` to the body to publish; bodies with a free joint: {names}")


def _on_diagonal(variances: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(np.diag(variances).reshape(-1).tolist())
