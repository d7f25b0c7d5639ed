"""Parses an unquoted value by the rules of ROS's own parameter parser, so that a file has the same values as in ROS.

Source: `rcl_yaml_param_parser`, function `get_value`. It uses C's `strtol` and `strtod`, so `012` is 10, `08` is 8.0,
and `1_000` and `1:30` are text, unlike in YAML 1.1 or 1.2.
"""

import re

Scalar = bool | int | float | str

_TRUE = frozenset({"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"})
_FALSE = frozenset({"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"})
_SPECIAL = re.compile(r"[+-]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")

_SPACE = r"[ \t\n\v\f\r]*"
_MAX_DIGITS = 22
"""Maximum number of digits of a 64-bit integer, which is in octal."""
_INTEGER = re.compile(rf"{_SPACE}([+-]?)(?:0[xX]([0-9a-fA-F]+)|(0[0-7]*)|([1-9][0-9]*))", re.ASCII)
_DECIMAL = re.compile(rf"{_SPACE}([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)", re.ASCII)
_HEXADECIMAL = re.compile(
    rf"{_SPACE}([+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?)", re.ASCII
)
_NAMED = re.compile(rf"{_SPACE}([+-]?)(?:(inf|infinity)|nan(?:\([A-Za-z0-9_]*\))?)", re.ASCII | re.IGNORECASE)


def ros_scalar(text: str) -> Scalar:
    """Returns the value that ROS reads from an unquoted scalar: a bool, a 64-bit int, a float, or the text itself."""
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    integer = _integer(text)
    if integer is not None:
        return integer
    number = _float(text)
    return text if number is None else number


def _integer(text: str) -> int | None:
    match = _INTEGER.fullmatch(text)
    if match is None:
        return None
    sign, hexadecimal, octal, decimal = match.groups()
    digits, base = (hexadecimal, 16) if hexadecimal else (octal, 8) if octal else (decimal, 10)
    digits = digits.lstrip("0") or "0"
    if len(digits) > _MAX_DIGITS:
        return None
    value = int(sign + digits, base)
    return value if -(2**63) <= value < 2**63 else None


def _float(text: str) -> float | None:
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", ""))
    if match := _NAMED.fullmatch(text):
        sign, infinite = match.groups()
        return float(f"{sign}inf") if infinite else float("nan")
    if match := _DECIMAL.fullmatch(text):
        digits, value = match[1], float(match[1])
        mantissa = re.split("[eE]", digits)[0]
    elif match := _HEXADECIMAL.fullmatch(text):
        digits = match[1]
        mantissa = re.split("[pP]", digits)[0].lower().replace("0x", "")
        try:
            value = float.fromhex(digits)
        except OverflowError:
            return None
    else:
        return None
    # strtod reports a number that is too large or too small for a double as out of range; ROS then uses the text.
    lost = value in (float("inf"), float("-inf")) or (value == 0.0 and re.search("[1-9a-fA-F]", mantissa))
    return None if lost else value
