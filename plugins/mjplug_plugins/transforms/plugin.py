"""The transforms plugin: publishes moving frames at a rate, and fixed frames once."""

from collections.abc import Sequence

from mjplug.plugin import LATCHED, CdrFrame, Host, Plugin, QoS
from mjplug_plugins.transforms.parameters import TransformsParameters
from mjplug_plugins.transforms.relative import Relative
from mjplug_plugins.transforms.tree import Link, links
from mjplug_schemas.geometry_msgs import TransformStamped
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.tf2_msgs import TFMessage

DYNAMIC = QoS(depth=100)
"""QoS of tf2's TransformBroadcaster."""

_NUMBERS = (*(f"translation.{axis}" for axis in "xyz"), *(f"rotation.{axis}" for axis in "wxyz"))


class Transforms(Plugin[TransformsParameters]):
    """Publishes the frames of bodies, cameras and sites as `tf2_msgs/TFMessage`, on `tf` and `tf_static`.

    The parent of a body's frame is the frame of its parent body. All transforms of a message belong to its stamp.
    """

    stateless = True

    def init(self, host: Host, parameters: TransformsParameters) -> None:
        """Finds the frames, publishes the fixed ones, and starts the timer for the others."""
        self._host = host
        all_links = links(host, parameters)
        if not all_links:
            host.logger.warning("the model has no body with a name, no camera and no sensor: no frames are published")
        moving, fixed = [link for link in all_links if not link.rigid], [link for link in all_links if link.rigid]
        sample = self._sample if moving else None
        self._publisher = host.create_publisher(TFMessage, parameters.topic, DYNAMIC, sample=sample)
        static = host.create_publisher(TFMessage, parameters.static_topic, LATCHED)
        if fixed:
            message = _Transforms(host, fixed)
            message.read()
            static.publish_frame(message.frame)
        if moving:
            self._message = _Transforms(host, moving)
            host.create_timer(1.0 / parameters.rate, self._publish, while_matched=self._publisher)

    def _publish(self) -> None:
        self._publisher.publish_frame(self._sample())

    def _sample(self) -> CdrFrame:
        self._message.read()
        return self._message.frame


class _Transforms:
    """A message with all constant fields filled in.

    Attributes:
        frame: The message.
    """

    def __init__(self, host: Host, links: Sequence[Link]) -> None:
        self._host = host
        self._relative = Relative(host.model, host.data, links)
        transforms = [
            TransformStamped(
                header=Header(frame_id=host.frame_id(link.parent_name)), child_frame_id=host.frame_id(link.frame.name)
            )
            for link in links
        ]
        self.frame = CdrFrame(TFMessage(transforms=transforms))
        every = range(len(links))
        self._poses = self.frame.slots(f"transforms[{i}].transform.{number}" for i in every for number in _NUMBERS)
        self._sec, self._nanosec = (
            self.frame.slots(f"transforms[{i}].header.stamp.{part}" for i in every) for part in ("sec", "nanosec")
        )

    def read(self) -> None:
        """Writes the current poses and the time into the message."""
        self._host.kinematics()
        self._relative.update()
        self._poses.write(self._relative.poses.reshape(-1))
        seconds, nanoseconds = divmod(self._host.time_ns, 1_000_000_000)
        self._sec.write(seconds)
        self._nanosec.write(nanoseconds)
