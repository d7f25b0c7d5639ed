"""The compressed images, decoded as ROS's image_transport plugins decode them."""

import struct

import cv2
import numpy as np
import pytest
from camera_scenes import (
    FLOOR,
    closing,  # noqa: F401 - a fixture
    gl,  # noqa: F401 - a fixture
    pixels,
    scene,
    world_of,
)

from mjplug_plugins.camera.compression import DepthCoding, jpeg

EYE = '<camera name="eye" pos="0 -2 2" euler="60 0 0" fovy="70" resolution="160 120"/>'
RED = '<geom type="box" size=".8 .8 .3" rgba="1 0 0 1"/>'


def decoded_depth(message):
    """As compressed_depth_image_transport reads it: 12 bytes of header, then a PNG of inverse depths; 0 is NaN."""
    encoding, _, rest = message.format.partition(";")
    assert (encoding, rest) == ("32FC1", " compressedDepth png")
    data = bytes(message.data)
    kind, a, b = struct.unpack_from("<iff", data)
    assert kind == 0
    inverse = cv2.imdecode(np.frombuffer(data, np.uint8, offset=12), cv2.IMREAD_UNCHANGED)
    assert inverse.dtype == np.uint16
    with np.errstate(divide="ignore"):
        return np.where(inverse == 0, np.nan, np.float32(a) / (inverse.astype(np.float32) - np.float32(b))), a


def test_the_jpeg_is_the_image():
    world = world_of(scene(EYE, FLOOR + RED))
    world.loop.step(100)
    (image,), (compressed,) = (world.published(f"/cameras/eye/{topic}") for topic in ("color", "color/compressed"))
    assert compressed.format == "rgb8; jpeg compressed bgr8"
    assert compressed.header == image.header
    bgr = cv2.imdecode(np.frombuffer(bytes(compressed.data), np.uint8), cv2.IMREAD_COLOR)
    difference = np.abs(bgr[:, :, ::-1].astype(int) - pixels(image))
    assert difference.mean() < 4
    blue, green, red = bgr[80, 80].tolist()
    assert red > 100
    assert max(blue, green) < 40


def test_the_quality_of_the_jpeg_can_be_set():
    sizes = []
    for quality in (20, 95):
        world = world_of(scene(EYE, FLOOR + RED), jpeg_quality=quality)
        world.loop.step(100)
        sizes.append(len(world.published("/cameras/eye/color/compressed")[0].data))
    assert sizes[0] < 0.7 * sizes[1]


@pytest.mark.parametrize("background", ["inf", "nan", "far", "zero"])
def test_the_compressed_depth_is_the_depth_within_its_quantisation(background):
    world = world_of(scene(EYE, FLOOR + RED), background=background)
    world.loop.step(100)
    (depth,), (compressed,) = (world.published(f"/cameras/eye/{topic}") for topic in ("depth", "depth/compressedDepth"))
    assert compressed.header == depth.header
    found, a = decoded_depth(compressed)
    exact = pixels(depth)
    something = np.isfinite(exact) & (exact > 0) & (exact < 99.9)
    assert exact.size / 4 < something.sum() < exact.size
    # Half a step of the inverse depth, and what float32 adds.
    assert (np.abs(found - exact)[something] < 0.51 * exact[something] ** 2 / a + 1e-4).all()
    if background != "far":
        assert np.isnan(found[~something]).all()


def test_what_the_coding_cannot_say_is_unknown():
    coding = DepthCoding(max_depth=50.0)
    depth = np.array([[0.0, -1.0, 0.1, 0.2, 49.9, 51.0, 60.0, np.inf, np.nan]], np.float32)
    inverse = cv2.imdecode(np.frombuffer(coding.encode(depth), np.uint8, offset=12), cv2.IMREAD_UNCHANGED)[0]
    assert inverse[3] == round(10100 / 0.2 + 1 - 10100 / 50)
    assert inverse[4] == 1
    assert [bool(code) for code in inverse] == [False, False, False, True, True, False, False, False, False]


def test_a_jpeg_of_one_pixel_is_possible():
    decoded = cv2.imdecode(np.frombuffer(jpeg(np.full((1, 1, 3), 77, np.uint8), 95), np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == (1, 1, 3)
    assert abs(int(decoded[0, 0, 0]) - 77) < 4
