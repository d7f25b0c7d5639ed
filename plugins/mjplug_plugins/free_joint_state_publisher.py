"""Publishes pose and velocity of bodies with a free joint, in the world frame or in the frame of a body."""

from itertools import product
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from mjplug.plugin import CdrFrame, Host, OneOrMore, Parameters, Plugin, UnknownName
from mjplug_plugins.free_body import FreeBody, free_bodies, free_body
from mjplug_schemas.geometry_msgs import PoseStamped, TwistStamped
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState, FreeJointStateArray
from mjplug_schemas.std_msgs import Header

Array = NDArray[np.float64]

_POSE = (
    *(f"pose.pose.position.{axis}" for axis in "xyz"),
    *(f"pose.pose.orientation.{axis}" for axis in "wxyz"),
)
"""The seven fields of a body's pose, in the order of `qpos`."""

_VELOCITIES = tuple(f"twist.twist.{part}.{axis}" for part in ("angular", "linear") for axis in "xyz")


class FreeJointStatePublisherParameters(Parameters):
    """Parameters of FreeJointStatePublisher."""

    frame_id: str = Field(default="", description="Body whose frame the states are in; empty: the world.")
    body_names: Annotated[tuple[str, ...], OneOrMore] = Field(
        default=(), description="Bodies to publish, in this order; empty: all with a free joint."
    )
    topic: str = Field(default="free_joint_states", description="Topic name.")
    publish_rate: float = Field(default=50.0, gt=0, description="Messages per second of simulated time [Hz].")

    @field_validator("body_names")
    @classmethod
    def _require_unique(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"list each body once; listed twice: {', '.join(map(repr, twice))}")
        return names


class FreeJointStatePublisher(Plugin[FreeJointStatePublisherParameters]):
    """Publishes the state of bodies with a free joint as `mujoco_ros2_control_msgs/FreeJointStateArray`.

    Both velocities are in the axes of the frame and relative to the world: the velocity of the frame's body is not
    subtracted. If the entries of a message are sent to `~/set_free_joint_state`, they restore exactly that state.
    """

    stateless = True

    def init(self, host: Host, parameters: FreeJointStatePublisherParameters) -> None:
        """Prepares the message and starts the timer."""
        self._host = host
        reference, frame_id = _frame(host, parameters.frame_id)
        bodies = _bodies(host, parameters.body_names)
        self._states = _States(host, bodies, reference)
        self._message = CdrFrame(_message(bodies, frame_id))
        every = range(len(bodies))
        poses = product(every, _POSE) if self._states.in_place else ((i, number) for number, i in product(_POSE, every))
        self._poses = self._message.slots(f"free_joints[{i}].{number}" for i, number in poses)
        self._velocities = self._message.slots(
            f"free_joints[{i}].{number}" for number, i in product(_VELOCITIES, every)
        )
        self._sec, self._nanosec = (self._message.slots(_stamps(len(bodies), part)) for part in ("sec", "nanosec"))
        self._seconds = 0
        self._publisher = host.create_publisher(FreeJointStateArray, parameters.topic, sample=self._sample)
        host.create_timer(1.0 / parameters.publish_rate, self._publish, while_matched=self._publisher)

    def _publish(self) -> None:
        self._publisher.publish_frame(self._sample())

    def _sample(self) -> CdrFrame:
        self._states.read()
        self._poses.write(self._states.poses)
        self._velocities.write(self._states.velocities)
        seconds, nanoseconds = divmod(self._host.time_ns, 1_000_000_000)
        if seconds != self._seconds:
            self._seconds = seconds
            self._sec.write(seconds)
        self._nanosec.write(nanoseconds)
        return self._message


class _States:
    """The poses and velocities of all bodies at one time.

    The values are stored with one row per field and one column per body, and computed for whole blocks of rows, because
    numpy is fastest without broadcasting. `take` with `clip` avoids a temporary copy; all indices are valid.

    Attributes:
        in_place: Whether `poses` is a view of `qpos`, because the poses are contiguous there.
        poses: The fields of `_POSE` [m, -] for n bodies, shape (7 n,): by body if `in_place`, else by field.
        velocities: The fields of `_VELOCITIES` [rad/s, m/s] for n bodies, by field, shape (6 n,).

    Args:
        host: Provides the state.
        bodies: The bodies.
        reference: Id of the body whose frame the values are in; 0: the world.
    """

    def __init__(self, host: Host, bodies: list[FreeBody], reference: int) -> None:
        self._host = host
        self._reference = reference
        self._qpos, self._qvel, self._xmat = host.data.qpos, host.data.qvel, host.data.xmat.reshape(-1)
        qpos, dof, xmat = (np.array(column, np.intp) for column in _addresses(bodies))
        linear, local = (dof + i for i in range(3)), [dof + 3 + i for i in range(3)]
        self._pose_index = np.concatenate([qpos + i for i in range(7)])
        # The elements of each rotation matrix, column by column, and the velocity to multiply each element by.
        self._xmat_index = np.concatenate([xmat + 3 * row + column for column in range(3) for row in range(3)])
        self._qvel_index = np.concatenate([*linear, *(velocity for velocity in local for _ in range(3))])
        n = len(bodies)
        store = np.empty(22 * n)
        self.poses, self.velocities = store[: 7 * n], store[7 * n : 13 * n]
        self._rows = store[: 13 * n].reshape(13, n)
        self._unturned, self._rotating = store[10 * n :], store[13 * n :]
        self._products = np.empty(9 * n)
        self._first, self._second, self._third = self._products.reshape(3, -1)
        self._angular = store[7 * n : 10 * n]
        self.in_place = not reference and bool(n) and np.array_equal(qpos, qpos[0] + 7 * np.arange(n))
        if self.in_place:
            self.poses = self._qpos[qpos[0] : qpos[0] + 7 * n]

    def read(self) -> None:
        """Reads the values of the current state."""
        self._host.kinematics()
        if not self.in_place:
            self._qpos.take(self._pose_index, out=self.poses, mode="clip")
        self._qvel.take(self._qvel_index, out=self._unturned, mode="clip")
        # MuJoCo's angular velocities are in body axes; this rotates them to world axes.
        self._xmat.take(self._xmat_index, out=self._products, mode="clip")
        np.multiply(self._products, self._rotating, self._products)
        np.add(self._first, self._second, self._angular)
        np.add(self._angular, self._third, self._angular)
        if self._reference:
            self._transform_to_reference()

    def _transform_to_reference(self) -> None:
        """Transforms the values from the world frame to the frame of the reference body."""
        data, reference = self._host.data, self._reference
        to_frame = data.xmat[reference].reshape(3, 3).T
        position, quat, angular, linear = np.split(self._rows, (3, 7, 10))
        position[:] = to_frame @ (position - data.xpos[reference][:, None])
        quat[:] = _left_product(data.xquat[reference] * (1.0, -1.0, -1.0, -1.0)) @ quat
        angular[:] = to_frame @ angular
        linear[:] = to_frame @ linear


def _bodies(host: Host, names: tuple[str, ...]) -> list[FreeBody]:
    if names:
        return [free_body(host, name) for name in names]
    found = free_bodies(host.model)
    named = [body for body in found if body.name]
    if len(named) < len(found):
        count = len(found) - len(named)
        host.logger.warning("not published, because they have no name: %d of the bodies with a free joint", count)
    if not named:
        host.logger.warning("the model has no body with a free joint: the messages are empty")
    return named


def _frame(host: Host, name: str) -> tuple[int, str]:
    """Returns the id of the reference body, 0 for the world, and the frame name to publish."""
    if not name:
        return 0, ""
    try:
        return host.body_id(name), name
    except UnknownName as error:
        host.logger.error("frame_id: %s; the world frame is used instead", error)
        return 0, ""


def _message(bodies: list[FreeBody], frame_id: str) -> FreeJointStateArray:
    header = Header(frame_id=frame_id)
    pose, twist = PoseStamped(header=header), TwistStamped(header=header)
    states = [FreeJointState(name=body.name, pose=pose, twist=twist) for body in bodies]
    return FreeJointStateArray(header=header, free_joints=states)


def _stamps(bodies: int, part: str) -> list[str]:
    headers = ["header", *(f"free_joints[{i}].{which}.header" for i in range(bodies) for which in ("pose", "twist"))]
    return [f"{header}.stamp.{part}" for header in headers]


def _addresses(bodies: list[FreeBody]) -> tuple[list[int], list[int], list[int]]:
    """Returns the start indices of each body in `qpos`, in `qvel` and in the flattened `xmat`."""
    return [body.qpos for body in bodies], [body.dof for body in bodies], [9 * body.body for body in bodies]


def _left_product(quat_wxyz: Array) -> Array:
    """Returns the matrix, shape (4, 4), that multiplies quaternions (w, x, y, z) by `quat_wxyz` from the left."""
    w, x, y, z = quat_wxyz
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
