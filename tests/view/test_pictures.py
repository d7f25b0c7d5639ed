"""Camera images for the page."""

import struct

import cv2
import numpy as np
import pytest
from view.page_client import IMAGE

from mjplug.client.errors import WrongTypeError
from mjplug.view import pictures
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.sensor_msgs import CompressedImage, Image
from mjplug_schemas.std_msgs import Header

STAMP = Header(stamp=Time(sec=3, nanosec=500_000_000))
RED = (255, 0, 0)


def message(encoding, pixels, padding=0, big=False):
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
    return Image(
        header=STAMP, height=height, width=width, encoding=encoding, is_bigendian=int(big), step=rows.shape[1],
        data=rows.tobytes(),
    )  # fmt: skip


def decoded(image):
    payload = pictures.encode(image.TYPE, bytes(image.to_cdr()))
    width, height, whole_width, whole_height, stamp = struct.unpack_from("<IIIId", payload)
    file = payload[24:]
    pixels = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels.shape[:2] == (height, width)
    assert stamp == 3.5
    return pixels, (whole_width, whole_height), file


def plain(colour, shape=(40, 60), dtype=np.uint8):
    return np.broadcast_to(np.array(colour, dtype), (*shape, len(colour)))


@pytest.mark.parametrize(
    ("encoding", "colour", "bgr"),
    [
        ("rgb8", (250, 10, 20), (20, 10, 250)),
        ("bgr8", (250, 10, 20), (250, 10, 20)),
        ("rgba8", (250, 10, 20, 255), (20, 10, 250)),
        ("bgra8", (250, 10, 20, 255), (250, 10, 20)),
    ],
)
@pytest.mark.parametrize("padding", [0, 5])
def test_colours_keep_their_order(encoding, colour, bgr, padding):
    pixels, size, file = decoded(message(encoding, plain(colour), padding))
    assert size == (60, 40)
    assert file[:2] == b"\xff\xd8"
    assert np.abs(pixels[20, 30].astype(int) - bgr).max() <= 4


def test_transparency_needs_a_png():
    pixels, _, file = decoded(message("rgba8", plain((250, 10, 20, 100))))
    assert file[1:4] == b"PNG"
    assert tuple(pixels[5, 5]) == (20, 10, 250, 100)


def test_grey_images_of_8_and_16_bits():
    assert abs(int(decoded(message("mono8", plain((90,))))[0][5, 5]) - 90) <= 2
    for big in (False, True):
        values = plain((90 * 256,), dtype=">u2" if big else "<u2")
        assert abs(int(decoded(message("mono16", values, big=big))[0][5, 5]) - 90) <= 2


@pytest.mark.parametrize(("encoding", "dtype", "unit"), [("32FC1", "<f4", 1.0), ("16UC1", "<u2", 1000.0)])
def test_depth_is_red_near_blue_far_and_black_where_there_is_none(encoding, dtype, unit):
    depth = np.zeros((40, 60, 1))
    depth[:, :20], depth[:, 20:40] = 1.0 * unit, 5.0 * unit
    pixels, *_ = decoded(message(encoding, depth.astype(dtype)))
    near, far, nothing = pixels[20, 10].astype(int), pixels[20, 30].astype(int), pixels[20, 55]
    assert near[2] > near[0] + 50
    assert far[0] > far[2]
    assert nothing.max() <= 10


@pytest.mark.parametrize("kind", ["16UC1", "32FC1"])
def test_compressed_depth_is_coloured_too(kind):
    depth = np.zeros((40, 60))
    depth[:, :20], depth[:, 20:40] = 1.0, 5.0
    scale, offset = 100.0, 1.0
    stored = depth * 1000.0 if kind == "16UC1" else np.where(depth > 0, scale / np.maximum(depth, 1e-9) + offset, 0.0)
    _, file = cv2.imencode(".png", stored.astype(np.uint16))
    data = struct.pack("<iff", 0, scale, offset) + file.tobytes()
    pixels, *_ = decoded(CompressedImage(header=STAMP, format=f"{kind}; compressedDepth png", data=data))
    near, far, nothing = pixels[20, 10].astype(int), pixels[20, 30].astype(int), pixels[20, 55]
    assert near[2] > near[0] + 50
    assert far[0] > far[2]
    assert nothing.max() <= 10


@pytest.mark.parametrize("values", [0.0, np.nan, np.inf, 2.5])
def test_depth_without_a_range_is_still_an_image(values):
    pixels, *_ = decoded(message("32FC1", np.full((8, 8, 1), values, "<f4")))
    assert pixels.shape == (8, 8, 3)


def test_a_large_image_is_scaled_down_and_its_size_reported():
    pixels, size, _ = decoded(message("mono8", plain((90,), (1000, 2560))))
    assert (pixels.shape[:2], size) == ((500, 1280), (2560, 1000))


def test_compressed_images_are_decoded():
    _, file = cv2.imencode(".png", plain((20, 10, 250)))
    pixels, *_ = decoded(CompressedImage(header=STAMP, format="png", data=file.tobytes()))
    assert np.abs(pixels[20, 30].astype(int) - (20, 10, 250)).max() <= 4


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (message("yuv422", plain((1, 2))), "the encoding 'yuv422' cannot be shown; known: rgb8, bgr8"),
        (Image(width=10, height=10, encoding="rgb8", step=30, data=b"x"), "needs at least 30 bytes per row"),
        (Image(width=10, height=10, encoding="rgb8", step=3, data=bytes(300)), "needs at least 30 bytes per row"),
        (Image(encoding="rgb8"), "an image of 0 x 0 pixels"),
        (CompressedImage(format="jpeg", data=b"garbage"), "in the format 'jpeg' cannot be decoded"),
        (CompressedImage(format="32FC1; compressedDepth png", data=b"short"), "compressedDepth png' cannot be decoded"),
        (CompressedImage(format="jpeg"), "in the format 'jpeg' cannot be decoded"),
    ],
)
def test_what_cannot_be_shown_has_a_reason(image, reason):
    with pytest.raises(WrongTypeError) as refused:
        pictures.encode(image.TYPE, bytes(image.to_cdr()))
    assert reason in str(refused.value)


def test_an_image_is_encoded_once_for_all_pages_and_only_if_it_can_be_taken(
    new_server, new_relay, new_page, monkeypatch
):
    encoded = []

    def counting(type, cdr):
        encoded.append(cdr)
        return genuine(type, cdr)

    genuine = pictures.encode
    monkeypatch.setattr(pictures, "encode", counting)
    server = new_server(topics={"/camera": "sensor_msgs/msg/Image"})
    relay = new_relay()
    pages = [new_page(relay, acknowledges=False) for _ in range(3)]
    for page in pages:
        if not page.hello["servers"]:
            page.text("servers")
        assert page.do(op="subscribe", topic="/camera", mode="image")["channel"] == 1
    server.matched("camera")
    for number in range(2):
        server.send("/camera", message("mono8", plain((50 * number,))))
        items = [page.item(IMAGE) for page in pages]
        assert len({item.payload for item in items}) == 1
    assert len(encoded) == 2
    for number in range(10):
        server.send("/camera", message("mono8", plain((20 * number,))))
    assert all(page.nothing() for page in pages)
    # One waits for each page, and the next ones are not encoded.
    assert len(encoded) <= 5
    for page in pages:
        batch, grey = 2, 0
        # The last one arrives, be it later on a busy machine.
        while abs(grey - 180) > 3:
            page.acknowledge(batch)
            batch += 1
            grey = int(cv2.imdecode(np.frombuffer(page.item(IMAGE).payload[24:], np.uint8), 0)[5, 5])


def test_an_image_that_cannot_be_shown_is_reported_once(new_server, page):
    server = new_server(topics={"/camera": "sensor_msgs/msg/Image"})
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="subscribe", topic="/camera", mode="image")
    server.matched("camera")
    strange = bytes(message("yuv422", plain((1, 2))).to_cdr())
    for payload, reason in ((strange, "yuv422"), (b"\0\1\0\0garbage", "cannot be decoded")):
        for _ in range(3):
            server.publisher("camera").put(payload)
        assert reason in page.text("error")["error"]
    assert page.nothing()
