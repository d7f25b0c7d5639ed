"""Compressed images in the formats of ROS's image_transport plugins."""

import struct
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_DEPTH_HEADER = struct.Struct("<iff")
"""Coding and its two parameters a and b."""

_INVERSE_DEPTH = 0

_DEPTH_QUANTIZATION = 100.0
"""image_transport's default `depth_quantization`; larger is finer. Depths below about 0.15 m are lost."""

_MAX_CODE = 65535

JPEG_FORMAT = "rgb8; jpeg compressed bgr8"
DEPTH_FORMAT = "32FC1; compressedDepth png"


def jpeg(rgb: NDArray[np.uint8], quality: int) -> bytes:
    """Returns an image as a JPEG file.

    Args:
        rgb: Pixels in the order red, green, blue, shape (rows, columns, 3).
        quality: JPEG quality, 1 to 100 [%].
    """
    return _encoded(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), (cv2.IMWRITE_JPEG_QUALITY, quality))


@dataclass(frozen=True, slots=True)
class DepthCoding:
    """The 16-bit coding of compressed_depth_image_transport: `a / depth + b`, finest for small depths.

    The resolution is about `depth² / a`. Zero stands for a depth that is unknown, too small or too large.

    Attributes:
        max_depth: Largest depth that can be coded [m].
    """

    max_depth: float

    @property
    def a(self) -> float:
        """The first parameter [m]."""
        return _DEPTH_QUANTIZATION * (_DEPTH_QUANTIZATION + 1.0)

    @property
    def b(self) -> float:
        """The second parameter."""
        return 1.0 - self.a / self.max_depth

    def encode(self, depth: NDArray[np.float32]) -> bytes:
        """Returns a depth image, shape (rows, columns) [m], as the coding header and a PNG file."""
        with np.errstate(divide="ignore", invalid="ignore"):
            code = np.float32(self.a) / depth
        code += np.float32(self.b)
        np.rint(code, out=code)
        # NaN fails both comparisons; a code below 1 is a depth beyond max_depth.
        code[~((code >= 1.0) & (code <= _MAX_CODE))] = 0.0
        image = _encoded(".png", code.astype(np.uint16), (cv2.IMWRITE_PNG_COMPRESSION, 1))
        return _DEPTH_HEADER.pack(_INVERSE_DEPTH, self.a, self.b) + image


def _encoded(suffix: str, image: NDArray[np.generic] | cv2.typing.MatLike, options: tuple[int, int]) -> bytes:
    done, encoded = cv2.imencode(suffix, image, options)  # type: ignore[arg-type]
    if not done:
        raise RuntimeError(f"OpenCV cannot encode an image of shape {image.shape} as a {suffix} file")
    return encoded.tobytes()
