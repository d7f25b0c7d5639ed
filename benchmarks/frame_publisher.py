"""What a work publishes to when its cost is measured without a network."""

import zenoh

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug_schemas.message import Message


class FramePublisher:
    """Copies a frame into Zenoh's memory, as a real publisher does."""

    def __init__(self, matched: bool = True) -> None:
        self.matched = matched

    def publish(self, message: Message) -> None:
        """Is for what is small, which a measured work is not to publish.

        Raises:
            TypeError: Always.
        """
        raise TypeError(f"a {message.TYPE} was built where a frame was to be measured")

    def publish_frame(self, frame: CdrFrame) -> None:
        """Copies it."""
        self.payload = zenoh.ZBytes(frame.buffer)
