"""An example of a plugin: publishes the pose of a body."""

from pydantic import Field

from mjplug.plugin import Host, Parameters, Plugin
from mjplug_schemas.geometry_msgs import Point, Pose, PoseStamped, Quaternion
from mjplug_schemas.std_msgs import Header


class TrackBodyParameters(Parameters):
    """Parameters of TrackBody."""

    body: str = Field(description="Name of the body.")
    rate: float = Field(default=50.0, gt=0, description="Messages per second of simulated time [Hz].")


class TrackBody(Plugin[TrackBodyParameters]):
    """Publishes a body's pose in the world frame on `~/pose` (geometry_msgs/PoseStamped)."""

    def init(self, host: Host, parameters: TrackBodyParameters) -> None:
        """Finds the body and creates the publisher and the timer."""
        self.host = host
        self.body = host.body_id(parameters.body)
        self.poses = host.create_publisher(PoseStamped, "~/pose")
        host.create_timer(1.0 / parameters.rate, self.publish, while_matched=self.poses)

    def publish(self) -> None:
        """Publishes the pose at the present simulated time."""
        self.host.kinematics()
        x, y, z = self.host.data.xpos[self.body].tolist()
        qw, qx, qy, qz = self.host.data.xquat[self.body].tolist()
        pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
        self.poses.publish(PoseStamped(header=Header(stamp=self.host.now(), frame_id="world"), pose=pose))
