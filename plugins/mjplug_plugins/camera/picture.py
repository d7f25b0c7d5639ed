"""Renders and publishes the messages of one camera."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import CdrFrame, Publisher
from mjplug_plugins.camera.compression import DEPTH_FORMAT, JPEG_FORMAT, DepthCoding, jpeg
from mjplug_plugins.camera.parameters import Background
from mjplug_plugins.camera.renderer import Renderer
from mjplug_plugins.camera.view import View
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.sensor_msgs import CameraInfo, CompressedImage, Image
from mjplug_schemas.std_msgs import Header


@dataclass(frozen=True, slots=True)
class Topics:
    """The publishers of one camera.

    Attributes:
        image: The colour image.
        depth: The depth image.
        info: The intrinsics.
        compressed: The colour image as JPEG.
        compressed_depth: The depth image in image_transport's format.
        segmentation: The geom or body id of each pixel; None if it is not configured.
    """

    image: Publisher[Image]
    depth: Publisher[Image]
    info: Publisher[CameraInfo]
    compressed: Publisher[CompressedImage]
    compressed_depth: Publisher[CompressedImage]
    segmentation: Publisher[Image] | None

    @classmethod
    def of(cls, view: View, publishers: Iterator[Publisher[Any]]) -> "Topics":
        """Takes the publishers that a view needs, in the order of the attributes."""
        image, depth, info, compressed, compressed_depth = (next(publishers) for _ in range(5))
        segmentation = None if view.segmentation == "none" else next(publishers)
        return cls(image, depth, info, compressed, compressed_depth, segmentation)

    def matched_topics(self) -> set[str]:
        """Returns which topics have subscribers, as the last word of their default names."""
        named: dict[str, Publisher[Any] | None] = {
            "color": self.image,
            "depth": self.depth,
            "camera_info": self.info,
            "compressed": self.compressed,
            "compressedDepth": self.compressed_depth,
            "segmentation": self.segmentation,
        }
        return {name for name, publisher in named.items() if publisher is not None and publisher.matched}


@dataclass(frozen=True, slots=True)
class Depths:
    """The values in depth images.

    Attributes:
        background: Kind of value for the background.
        far: Distance of the far plane [m].
    """

    background: Background
    far: float

    @property
    def background_depth(self) -> float:
        """The depth value of the background [m]."""
        return {"inf": np.inf, "nan": np.nan, "far": self.far, "zero": 0.0}[self.background]


class Picture:
    """The buffers, messages and publishers of one camera.

    Args:
        view: What the camera shows.
        topics: The publishers.
        model: The compiled model.
        depths: The values in depth images.
        jpeg_quality: JPEG quality, 1 to 100 [%].
    """

    def __init__(self, view: View, topics: Topics, model: mujoco.MjModel, depths: Depths, jpeg_quality: int) -> None:
        self._view = view
        self._topics = topics
        self._background_depth = depths.background_depth
        self._coding = DepthCoding(depths.far)
        self._jpeg_quality = jpeg_quality
        shape = view.height, view.width
        self._colour = np.zeros((*shape, 3), np.uint8)
        self._depth = np.zeros(shape, np.float32)
        self._background = np.zeros(shape, np.bool_)
        self._image, self._image_rows = _image(view, "rgb8", np.dtype(np.uint8), 3)
        self._depth_image, self._depth_rows = _image(view, "32FC1", np.dtype("<f4"))
        self._info = CdrFrame(view.info())
        if view.segmentation != "none":
            self._segmentation, self._segmentation_rows = _image(view, "32SC1", np.dtype("<i4"))
            self._geoms = np.zeros(shape, np.int32)
            numbers = model.geom_bodyid if view.segmentation == "body" else np.arange(model.ngeom)
            # Index -1, the last element, stands for no geom.
            self._numbers = np.append(numbers, -1).astype(np.int32)

    def publish(self, renderer: Renderer, data: mujoco.MjData, time_ns: int, triggered: bool) -> tuple[str, ...]:
        """Renders and publishes the messages whose topics have subscribers.

        Args:
            renderer: The renderer.
            data: The state to render.
            time_ns: Time of the state, for the stamps [ns].
            triggered: Whether colour and depth are rendered even without subscribers.

        Returns:
            The topics with subscribers, such as `color` and `depth`.
        """
        topics = self._topics
        matched = topics.matched_topics()
        self._render(
            renderer,
            data,
            colour=triggered or not matched.isdisjoint({"color", "compressed"}),
            depth=triggered or not matched.isdisjoint({"depth", "compressedDepth"}),
            segmentation="segmentation" in matched,
        )
        for frame in (self._image, self._depth_image, self._info):
            frame.set_stamp("header.stamp", time_ns)
        if "color" in matched:
            topics.image.publish_frame(self._image)
        if "depth" in matched:
            topics.depth.publish_frame(self._depth_image)
        if "camera_info" in matched:
            topics.info.publish_frame(self._info)
        if topics.segmentation is not None and "segmentation" in matched:
            self._segmentation.set_stamp("header.stamp", time_ns)
            topics.segmentation.publish_frame(self._segmentation)
        header = Header(stamp=Time.from_ns(time_ns), frame_id=self._view.frame)
        if "compressed" in matched:
            packed = jpeg(self._image_rows, self._jpeg_quality)
            topics.compressed.publish(CompressedImage(header=header, format=JPEG_FORMAT, data=packed))
        if "compressedDepth" in matched:
            packed = self._coding.encode(self._depth_rows)
            topics.compressed_depth.publish(CompressedImage(header=header, format=DEPTH_FORMAT, data=packed))
        return tuple(sorted(matched))

    def _render(self, renderer: Renderer, data: mujoco.MjData, colour: bool, depth: bool, segmentation: bool) -> None:
        if not (colour or depth or segmentation):
            return
        view = self._view
        renderer.set_view(data, view.camera, view.width, view.height)
        if colour or depth:
            renderer.draw(self._colour if colour else None, self._depth if depth else None)
        # The first row in OpenGL is at the bottom of the image.
        if colour:
            self._image_rows[:] = self._colour[::-1]
        if depth:
            np.equal(self._depth, 0.0, out=self._background)
            renderer.to_metres(self._depth)
            np.copyto(self._depth, self._background_depth, where=self._background)
            self._depth_rows[:] = self._depth[::-1]
        if segmentation:
            renderer.draw_geoms(self._geoms)
            self._segmentation_rows[:] = self._numbers[self._geoms[::-1]]


def _image(view: View, encoding: str, dtype: "np.dtype[Any]", channels: int = 1) -> tuple[CdrFrame, NDArray[Any]]:
    """Returns an image message and a view of its pixels, shape (rows, columns) or (rows, columns, channels)."""
    step = view.width * channels * dtype.itemsize
    frame = CdrFrame(
        Image(
            header=Header(frame_id=view.frame),
            height=view.height,
            width=view.width,
            encoding=encoding,
            step=step,
            data=bytes(step * view.height),
        )
    )
    shape = (view.height, view.width) if channels == 1 else (view.height, view.width, channels)
    return frame, frame.view("data").view(dtype).reshape(shape)
