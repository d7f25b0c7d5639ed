"""The ROS package geometry_msgs: points, poses, velocities, forces and their frames. Units are SI throughout."""

from typing import Annotated

from pydantic import Field

from mjplug_schemas.idl import Exactly, float32, float64, int64, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class Point(Message):
    """A position in space."""

    x: float64 = Field(0.0, description="Along x [m].")
    y: float64 = Field(0.0, description="Along y [m].")
    z: float64 = Field(0.0, description="Along z [m].")


class Vector3(Message):
    """A vector in space; its unit is defined by the message that contains it."""

    x: float64 = Field(0.0, description="Along x.")
    y: float64 = Field(0.0, description="Along y.")
    z: float64 = Field(0.0, description="Along z.")


class Quaternion(Message):
    """An orientation in space as a unit quaternion; the default value is no rotation."""

    x: float64 = Field(0.0, description="The x part.")
    y: float64 = Field(0.0, description="The y part.")
    z: float64 = Field(0.0, description="The z part.")
    w: float64 = Field(1.0, description="The real part.")


class Point32(Message):
    """A position in space, in single precision."""

    x: float32 = Field(0.0, description="Along x [m].")
    y: float32 = Field(0.0, description="Along y [m].")
    z: float32 = Field(0.0, description="Along z [m].")


class Pose(Message):
    """A position and an orientation."""

    position: Point = Field(Point(), description="Position [m].")
    orientation: Quaternion = Field(Quaternion(), description="Orientation.")


class Pose2D(Message):
    """A position and a heading in a plane."""

    x: float64 = Field(0.0, description="Along x [m].")
    y: float64 = Field(0.0, description="Along y [m].")
    theta: float64 = Field(0.0, description="The heading, counter-clockwise from x [rad].")


class Transform(Message):
    """The change from one frame to another."""

    translation: Vector3 = Field(Vector3(), description="Translation [m].")
    rotation: Quaternion = Field(Quaternion(), description="Rotation.")


class Twist(Message):
    """A velocity."""

    linear: Vector3 = Field(Vector3(), description="Linear velocity [m/s].")
    angular: Vector3 = Field(Vector3(), description="Angular velocity [rad/s].")


class Accel(Message):
    """An acceleration."""

    linear: Vector3 = Field(Vector3(), description="Linear acceleration [m/s²].")
    angular: Vector3 = Field(Vector3(), description="Angular acceleration [rad/s²].")


class Wrench(Message):
    """A force and a torque."""

    force: Vector3 = Field(Vector3(), description="The force [N].")
    torque: Vector3 = Field(Vector3(), description="The torque [N·m].")


class Inertia(Message):
    """The mass distribution of a body."""

    m: float64 = Field(0.0, description="The mass [kg].")
    com: Vector3 = Field(Vector3(), description="The centre of mass [m].")
    ixx: float64 = Field(0.0, description="The xx entry of the inertia tensor [kg·m²].")
    ixy: float64 = Field(0.0, description="The xy entry of the inertia tensor [kg·m²].")
    ixz: float64 = Field(0.0, description="The xz entry of the inertia tensor [kg·m²].")
    iyy: float64 = Field(0.0, description="The yy entry of the inertia tensor [kg·m²].")
    iyz: float64 = Field(0.0, description="The yz entry of the inertia tensor [kg·m²].")
    izz: float64 = Field(0.0, description="The zz entry of the inertia tensor [kg·m²].")


class Polygon(Message):
    """An area in space, bounded by straight edges."""

    points: sequence[Point32] = Field((), description="The corners; the last is joined to the first [m].")


class PolygonInstance(Message):
    """A polygon with an identifier."""

    polygon: Polygon = Field(Polygon(), description="The polygon.")
    id: int64 = Field(0, description="Its number.")


class PoseWithCovariance(Message):
    """A pose with its covariance."""

    pose: Pose = Field(Pose(), description="The pose.")
    covariance: Annotated[sequence[float64], Exactly(36)] = Field(
        (0.0,) * 36,
        description="The 6x6 covariance, row by row, over x, y, z and the rotations about x, y, z [m, rad].",
    )


class TwistWithCovariance(Message):
    """A velocity with its covariance."""

    twist: Twist = Field(Twist(), description="The velocity.")
    covariance: Annotated[sequence[float64], Exactly(36)] = Field(
        (0.0,) * 36,
        description="The 6x6 covariance, row by row, over linear and angular velocity along x, y, z [m/s, rad/s].",
    )


class AccelWithCovariance(Message):
    """An acceleration with its covariance."""

    accel: Accel = Field(Accel(), description="The acceleration.")
    covariance: Annotated[sequence[float64], Exactly(36)] = Field(
        (0.0,) * 36,
        description="The 6x6 covariance, row by row, over linear and angular parts along x, y, z [m/s², rad/s²].",
    )


class PoseArray(Message):
    """Several poses in one frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    poses: sequence[Pose] = Field((), description="The poses.")


class PointStamped(Message):
    """A position, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    point: Point = Field(Point(), description="The position [m].")


class Vector3Stamped(Message):
    """A vector, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    vector: Vector3 = Field(Vector3(), description="The vector.")


class QuaternionStamped(Message):
    """An orientation, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    quaternion: Quaternion = Field(Quaternion(), description="The orientation.")


class PoseStamped(Message):
    """A pose, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    pose: Pose = Field(Pose(), description="The pose.")


class TwistStamped(Message):
    """A velocity, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    twist: Twist = Field(Twist(), description="The velocity [m/s, rad/s].")


class AccelStamped(Message):
    """An acceleration, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    accel: Accel = Field(Accel(), description="The acceleration [m/s², rad/s²].")


class WrenchStamped(Message):
    """A force and a torque, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    wrench: Wrench = Field(Wrench(), description="The force and torque [N, N·m].")


class InertiaStamped(Message):
    """A mass distribution, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    inertia: Inertia = Field(Inertia(), description="The mass distribution.")


class PolygonStamped(Message):
    """A polygon, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    polygon: Polygon = Field(Polygon(), description="The polygon.")


class PolygonInstanceStamped(Message):
    """A numbered polygon, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    polygon: PolygonInstance = Field(PolygonInstance(), description="The polygon and its id.")


class PoseWithCovarianceStamped(Message):
    """A pose and its covariance, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    pose: PoseWithCovariance = Field(PoseWithCovariance(), description="The pose and its covariance.")


class TwistWithCovarianceStamped(Message):
    """A velocity and its covariance, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    twist: TwistWithCovariance = Field(TwistWithCovariance(), description="The velocity and its covariance.")


class AccelWithCovarianceStamped(Message):
    """An acceleration and its covariance, with its time and frame."""

    header: Header = Field(Header(), description="The time of the data and the frame it is in.")
    accel: AccelWithCovariance = Field(AccelWithCovariance(), description="The acceleration and its covariance.")


class TransformStamped(Message):
    """The transform from one named frame to another."""

    header: Header = Field(Header(), description="The time, and the parent frame.")
    child_frame_id: string = Field("", description="The child frame.")
    transform: Transform = Field(Transform(), description="The child's pose in the parent frame [m].")


class VelocityStamped(Message):
    """The velocity of one frame relative to another, expressed in a third frame."""

    header: Header = Field(Header(), description="The time, and the frame the velocity is expressed in.")
    body_frame_id: string = Field("", description="The frame that moves.")
    reference_frame_id: string = Field("", description="The frame it moves relative to.")
    velocity: Twist = Field(Twist(), description="The velocity [m/s, rad/s].")
