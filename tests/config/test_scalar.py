import ctypes
import math
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mjplug.config.scalar import ros_scalar

TABLE = [
    ("true", True),
    ("on", True),
    ("y", True),
    ("YES", True),
    ("False", False),
    ("off", False),
    ("n", False),
    ("oN", "oN"),
    ("tRUE", "tRUE"),
    ("0", 0),
    ("-7", -7),
    ("+7", 7),
    ("012", 10),
    ("08", 8.0),
    ("0x1F", 31),
    ("-0x10", -16),
    ("0x", "0x"),
    ("1_000", "1_000"),
    ("1:30", "1:30"),
    ("9223372036854775807", 2**63 - 1),
    ("9223372036854775808", float(2**63)),
    ("-9223372036854775808", -(2**63)),
    ("1.0", 1.0),
    ("1.", 1.0),
    (".5", 0.5),
    ("1e3", 1000.0),
    ("1E-2", 0.01),
    ("1e", "1e"),
    (".", "."),
    ("0x1.8p1", 3.0),
    ("inf", math.inf),
    ("-Infinity", -math.inf),
    (".inf", math.inf),
    ("-.INF", -math.inf),
    (".iNF", ".iNF"),
    ("1e999", "1e999"),
    ("1e-999", "1e-999"),
    ("0x1p99999", "0x1p99999"),
    ("null", "null"),
    ("", ""),
    ("2026-01-01", "2026-01-01"),
    ("1 2", "1 2"),
    ("٣", "٣"),
]


@pytest.mark.parametrize(("text", "value"), TABLE)
def test_a_scalar_is_what_ros_reads(text, value):
    assert ros_scalar(text) == value
    assert type(ros_scalar(text)) is type(value)


@pytest.mark.parametrize("text", ["nan", "NaN", ".nan", ".NAN", "-nan", "nan(7)"])
def test_nan_is_a_float(text):
    value = ros_scalar(text)
    assert isinstance(value, float)
    assert math.isnan(value)


@pytest.mark.skipif(sys.platform != "linux", reason="compares with glibc")
@given(
    st.from_regex(r"[ ]?[+-]?(0[xX]?)?[0-9a-fA-F_:]{0,12}(\.[0-9a-f]{0,6})?([eEpP][+-]?[0-9]{1,3})?", fullmatch=True)
    | st.text(st.sampled_from("0123456789+-.eExXinfaNy() _"), max_size=12)
    | st.integers(-(2**70), 2**70).map(str)
    | st.floats().map(repr)
)
@example("00000000000000000000000000000000000017")
@example("0x")
@example("+.inf")
def test_a_scalar_is_what_the_c_library_makes_of_it(text):
    expected = _as_rcl_does(text)
    if isinstance(expected, float) and 0 < abs(expected) < sys.float_info.min:
        return  # whether strtod calls a subnormal number out of range depends on how it rounds
    value = ros_scalar(text)
    if isinstance(value, float) and 0 < abs(value) < sys.float_info.min:
        return
    assert type(value) is type(expected)
    assert value == expected or (math.isnan(value) and math.isnan(expected))


def _as_rcl_does(text):
    """The order of questions in rcl_yaml_param_parser, asked of the C library itself."""
    if text in {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}:
        return True
    if text in {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}:
        return False
    whole, number = _c("strtol", ctypes.c_long, text)
    if whole:
        return number
    if text in {".nan", ".NaN", ".NAN", *(sign + inf for sign in ("", "+", "-") for inf in (".inf", ".Inf", ".INF"))}:
        return float(text.replace(".", ""))
    whole, number = _c("strtod", ctypes.c_double, text)
    return number if whole else text


def _c(name, result, text):
    function = getattr(ctypes.CDLL(None, use_errno=True), name)
    function.restype = result
    buffer = ctypes.create_string_buffer(text.encode())
    end = ctypes.c_char_p()
    ctypes.set_errno(0)
    arguments = [buffer, ctypes.byref(end)] + ([0] if name == "strtol" else [])
    number = function(*arguments)
    return ctypes.get_errno() == 0 and bool(text) and end.value == b"", number
