"""Responses of step requests in CDR, into which the observed values are written without further copies."""

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.physics.memory import float_view
from mjplug.services.stepping.arrays import Observed
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.mjplug_msgs import Step

_MAX_VALUES = 4096
"""Maximum number of observed values in a frame; larger responses are rare, and the memory of frames is kept."""

_MAX_FRAMES = 64
"""Maximum number of frames that are kept for later requests; they need at most 2 MiB."""


class ResponseFrame:
    """A response to one kind of requests, whose numbers are written in place.

    Attributes:
        frame: The response.
        values: The observed values in it, to be written.
        set_times: Writes the number of steps, the seconds and nanoseconds of the time stamp, and the epoch.

    Args:
        widths: Number of values of each observed array.
        count: Number of all observed values.
    """

    def __init__(self, widths: tuple[int, ...], count: int) -> None:
        self.frame = CdrFrame(
            Step.Response.unchecked(
                success=True,
                message="",
                step=0,
                stamp=Time(),
                epoch=0,
                observations=memoryview(bytes(8 * count)).cast("d"),
                widths=widths,
                outputs=(),
            )
        )
        self.values = float_view(self.frame.view("observations"))
        self.set_times = self.frame.writer(("step", "stamp", "epoch"))


class ResponseFrames:
    """Frames for the responses of earlier requests. Only one request may use them at a time."""

    def __init__(self) -> None:
        self._frames: dict[tuple[tuple[int, ...], int], ResponseFrame] = {}

    def frame(self, observed: Observed, actions: int) -> ResponseFrame | None:
        """Returns the frame for the response to a request; None if the response is too large.

        Args:
            observed: The observed arrays.
            actions: Number of actions.
        """
        key = observed.widths, actions
        frame = self._frames.get(key)
        if frame is None:
            count = observed.width * actions
            if count > _MAX_VALUES:
                return None
            if len(self._frames) >= _MAX_FRAMES:
                self._frames.clear()
            frame = self._frames[key] = ResponseFrame(observed.widths, count)
        return frame
