"""Camera images as files for the page: JPEG, or PNG if some pixels are transparent. It runs on a thread of its own."""

import math
import struct
import sys
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mjplug.client.errors import WrongTypeError
from mjplug_schemas.sensor_msgs import CompressedImage, Image

MAX_SIDE = 1280
"""A larger image is scaled down to this width or height [px]."""

_QUALITY = 85

_HEADER = struct.Struct("<IIIId")
"""Width and height of the file, width and height of the image [px], time stamp [s]."""

_FORMATS: dict[str, tuple[str, int, int | None]] = {
    "rgb8": ("u1", 3, cv2.COLOR_RGB2BGR),
    "bgr8": ("u1", 3, None),
    "8UC3": ("u1", 3, None),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2BGRA),
    "bgra8": ("u1", 4, None),
    "8UC4": ("u1", 4, None),
    "mono8": ("u1", 1, None),
    "8UC1": ("u1", 1, None),
    "mono16": ("u2", 1, None),
    "16UC1": ("u2", 1, None),
    "32FC1": ("f4", 1, None),
}
"""Type of the numbers, number of channels, and conversion to the order of OpenCV, by ROS encoding."""

_DEPTH_HEADER = struct.Struct("<iff")
"""Header of an image in the format compressedDepth: its kind, and the two constants of the quantisation."""

_DEPTHS = ("16UC1", "32FC1")


def encode(type: str, cdr: bytes) -> bytes:
    """Returns an image as the payload of an item for the page.

    Args:
        type: `sensor_msgs/msg/Image` or `sensor_msgs/msg/CompressedImage`.
        cdr: The message.

    Raises:
        WrongTypeError: The image has a format that cannot be shown.
        CodecError: The message is not valid.
    """
    pixels: Any
    if type == CompressedImage.TYPE:
        compressed = CompressedImage.from_cdr(cdr)
        pixels, stamp = _decompressed(compressed), compressed.header.stamp
    else:
        image = Image.from_cdr(cdr)
        pixels, stamp = _pixels(image), image.header.stamp
    height, width = pixels.shape[:2]
    scale = min(1.0, MAX_SIDE / max(height, width))
    if scale < 1.0:
        size = max(1, round(width * scale)), max(1, round(height * scale))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    if pixels.ndim == 3 and pixels.shape[2] == 4 and pixels[..., 3].min() == 255:
        pixels = pixels[..., :3]
    if pixels.ndim == 3 and pixels.shape[2] == 4:
        _, file = cv2.imencode(".png", pixels)
    else:
        _, file = cv2.imencode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))
    seconds = stamp.sec + stamp.nanosec / 1e9
    return _HEADER.pack(pixels.shape[1], pixels.shape[0], width, height, seconds) + file.tobytes()


def _decompressed(image: CompressedImage) -> NDArray[np.uint8]:
    """Returns the pixels of a compressed image, as `_pixels` does."""
    depth = "compressedDepth" in image.format
    data = np.frombuffer(image.data, np.uint8)[_DEPTH_HEADER.size if depth else 0 :]
    try:
        pixels: Any = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    except cv2.error:
        pixels = None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise WrongTypeError(f"an image in the format {image.format!r} cannot be decoded")
    if not depth:
        return np.asarray(pixels if pixels.dtype == np.uint8 else pixels >> 8, np.uint8)
    if image.format.startswith("32FC1"):
        # The file contains the inverse of the depth, scaled.
        _, scale, offset = _DEPTH_HEADER.unpack_from(image.data)
        with np.errstate(divide="ignore"):
            pixels = np.where(pixels > 0, scale / (pixels.astype(np.float32) - offset), 0.0)
    return _coloured(pixels)


def _pixels(image: Image) -> NDArray[np.uint8]:
    """Returns the pixels of an image for OpenCV, shape (height, width) or (height, width, 3 or 4)."""
    if image.encoding not in _FORMATS:
        raise WrongTypeError(
            f"an image with the encoding {image.encoding!r} cannot be shown; known: {', '.join(_FORMATS)}"
        )
    kind, channels, conversion = _FORMATS[image.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if image.is_bigendian else "<")
    row = image.width * channels * dtype.itemsize
    if image.width < 1 or image.height < 1 or image.step < row or len(image.data) < image.step * image.height:
        raise WrongTypeError(
            f"an image of {image.width} x {image.height} pixels ({image.encoding}) with {image.step} bytes per row "
            f"and {len(image.data)} bytes cannot be shown; it needs at least {row} bytes per row"
        )
    rows = np.frombuffer(image.data, np.uint8, image.step * image.height).reshape(image.height, image.step)
    values = np.ascontiguousarray(rows[:, :row]).view(dtype).reshape(image.height, image.width, channels)
    if image.encoding in _DEPTHS:
        return _coloured(values[..., 0])
    if image.encoding == "mono16":
        values = (values >> 8).astype(np.uint8)
    if conversion is not None:
        return np.asarray(cv2.cvtColor(values, conversion), np.uint8)
    return np.asarray(values[..., 0] if channels == 1 else values, np.uint8)


def _coloured(depths: NDArray[Any]) -> NDArray[np.uint8]:
    """Returns depths as colours from red (near) to blue (far); black where there is none."""
    values = depths.astype(np.float32)
    valid = np.isfinite(values) & (values > 0.0)
    near, far = np.percentile(values[valid], (1.0, 99.0)) if valid.any() else (0.0, 1.0)
    span = max(float(far - near), sys.float_info.min if math.isclose(near, far) else 1e-9)
    level = np.clip(255.0 * (1.0 - (np.where(valid, values, near) - near) / span), 0.0, 255.0).astype(np.uint8)
    coloured = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_TURBO), np.uint8)
    coloured[~valid] = 0
    return coloured
