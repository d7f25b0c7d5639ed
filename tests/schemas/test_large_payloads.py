"""Images and point clouds: a million bytes must cost what copying them costs."""

from timeit import repeat

import numpy as np
import pytest

from mjplug_schemas.errors import CodecError
from mjplug_schemas.sensor_msgs import Image, PointCloud2, PointField
from mjplug_schemas.std_msgs import Header

PIXELS = np.random.default_rng(0).integers(0, 256, 640 * 480 * 3, np.uint8)
OCTETS = PIXELS.tobytes()
XYZI = tuple(
    PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
    for i, name in enumerate(("x", "y", "z", "intensity"))
)
IMAGE = Image(header=Header(frame_id="optical"), height=480, width=640, encoding="rgb8", step=1920, data=OCTETS)
CLOUD = PointCloud2(
    header=Header(frame_id="lidar"),
    height=1,
    width=57600,
    fields=XYZI,
    point_step=16,
    row_step=len(OCTETS),
    data=OCTETS,
    is_dense=True,
)
BOTH = pytest.mark.parametrize("large", [IMAGE, CLOUD], ids=["image", "cloud"])
# Element by element it takes 10 ms and more, as a copy below 0.1 ms: this tells the two apart on any machine.
MAX_SECONDS = 2e-3


@BOTH
def test_a_large_payload_is_what_rosbags_writes_and_reads(large, rosbags):
    encoded = large.to_cdr()
    assert encoded == rosbags.encode(large)
    assert rosbags.decode(type(large), encoded) == large
    assert type(large).from_cdr(encoded) == large
    assert type(large).from_cdr(rosbags.encode(large, little_endian=False)) == large


@BOTH
@pytest.mark.parametrize(
    "data", [OCTETS, bytearray(OCTETS), memoryview(OCTETS), PIXELS], ids=lambda data: type(data).__name__
)
def test_a_large_payload_is_copied_not_counted(large, data):
    kind = type(large)
    encoded = large.to_cdr()
    assert kind(data=data).data == OCTETS
    for work in (lambda: kind(data=data), large.to_cdr, lambda: kind.from_cdr(encoded)):
        assert min(repeat(work, number=1, repeat=20)) < MAX_SECONDS


def test_bytes_are_taken_from_every_second_element_as_well():
    assert Image(data=PIXELS[::2]).data == OCTETS[::2]


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (PIXELS[:6].reshape(2, 3), r"but element 0 is \["),
        (PIXELS[:3].astype(np.float32), "but element 0 is "),
        (np.array([1, -1], np.int8), "but element 1 is -1"),
    ],
    ids=["rows", "floats", "signed"],
)
def test_an_array_that_is_not_a_list_of_octets_is_refused(data, sentence):
    with pytest.raises(ValueError, match=sentence):
        Image(data=data)


@BOTH
def test_a_large_payload_cut_short_is_explained(large):
    with pytest.raises(CodecError, match=r"data at byte \d+: expected 921600 bytes, 921600 bytes or more, but \d+"):
        type(large).from_cdr(large.to_cdr()[:-100])
