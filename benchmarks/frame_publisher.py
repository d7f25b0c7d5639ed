"""A publisher that replaces the network in measurements."""

import zenoh

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug_schemas.message import Message


class FramePublisher:
    """Copies a frame into Zenoh's memory, as a real publisher does."""

    def __init__(self, matched: bool = True) -> None:
        self.matched = matched

    def publish(self, message: Message) -> None:
        """Refuses messages that are not prepared frames, because the measured code must publish frames.

        Raises:
            TypeError: Always.
        """
        raise TypeError(f"expected a frame, got a {message.TYPE} message")

    def publish_frame(self, frame: CdrFrame) -> None:
        """Copies the frame."""
        self.payload = zenoh.ZBytes(frame.buffer)
