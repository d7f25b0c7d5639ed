"""The compressed images that ROS's image_transport plugins read."""

import struct
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_DEPTH_HEADER = struct.Struct("<iff")
"""Kind of coding, and its two parameters."""

_INVERSE_DEPTH = 0

_QUANTUM = 100.0
"""image_transport's usual `depth_quantization`: the larger, the finer; what is nearer than about 0.15 m is lost."""

_LARGEST = 65535

JPEG_FORMAT = "rgb8; jpeg compressed bgr8"
DEPTH_FORMAT = "32FC1; compressedDepth png"


def jpeg(rgb: NDArray[np.uint8], quality: int) -> bytes:
    """Returns an image, of shape (rows, columns, 3), as a JPEG file.

    Args:
        rgb: Its pixels, red first.
        quality: 1 to 100 [%].
    """
    return _encoded(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), (cv2.IMWRITE_JPEG_QUALITY, quality))


@dataclass(frozen=True, slots=True)
class DepthCoding:
    """How compressed_depth_image_transport packs metres into 16 bits: as `a / depth + b`, finest where it is near.

    A step is about `depth² / a` wide. Zero is what is unknown, or too near or too far for the numbers.

    Attributes:
        farthest: The largest depth that is coded [m].
    """

    farthest: float

    @property
    def a(self) -> float:
        """The first parameter [m]."""
        return _QUANTUM * (_QUANTUM + 1.0)

    @property
    def b(self) -> float:
        """The second parameter."""
        return 1.0 - self.a / self.farthest

    def encode(self, depth: NDArray[np.float32]) -> bytes:
        """Returns a depth image, of shape (rows, columns), in metres, as its header and a PNG file."""
        with np.errstate(divide="ignore", invalid="ignore"):
            code = np.float32(self.a) / depth
        code += np.float32(self.b)
        np.rint(code, out=code)
        # NaN is neither; what is coded as less than 1 is beyond the farthest.
        code[~((code >= 1.0) & (code <= _LARGEST))] = 0.0
        image = _encoded(".png", code.astype(np.uint16), (cv2.IMWRITE_PNG_COMPRESSION, 1))
        return _DEPTH_HEADER.pack(_INVERSE_DEPTH, self.a, self.b) + image


def _encoded(suffix: str, image: NDArray[np.generic] | cv2.typing.MatLike, options: tuple[int, int]) -> bytes:
    done, encoded = cv2.imencode(suffix, image, options)  # type: ignore[arg-type]
    if not done:
        raise RuntimeError(f"OpenCV cannot write a {suffix} file of an image of shape {image.shape}")
    return encoded.tobytes()
