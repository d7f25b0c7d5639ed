r"""POSIX extended regular expressions, searched in names.

Python's `re` takes seconds for some patterns, during which physics would wait; the functions of the C library take time
in proportion to the text, and they are the ones that the standard means (`[[:digit:]]` instead of `\d`).
"""

import ctypes
import re
import sys
from collections.abc import Callable

from mjplug.errors import RequestError, quoted

MAX_PATTERN_BYTES = 1000
"""Maximum length of a pattern [bytes]."""

MAX_REPETITIONS = 1000
"""Maximum product of all numbers of repetitions in a pattern, because the C library copies what is repeated."""

_EXTENDED = 1
_NOSUB = 4 if sys.platform == "darwin" else 8
_REGEX_BYTES = 512
"""Larger than `regex_t` of any C library."""

_BRACKETS = re.compile(r"\[\^?\]?(?:\[[:.=].*?[:.=]\]|[^\]])*\]")
_REPETITION = re.compile(r"\{\s*(\d*)\s*,?\s*(\d*)\s*\}")
_CLASSES = {
    "alpha": "A-Za-z",
    "digit": "0-9",
    "alnum": "A-Za-z0-9",
    "upper": "A-Z",
    "lower": "a-z",
    "space": r" \t\n\r\f\v",
    "blank": r" \t",
    "punct": r"!-/:-@\[-`{-~",
    "xdigit": "0-9A-Fa-f",
}

Search = Callable[[str], bool]


def search(pattern: str) -> Search:
    """Returns a function that tells whether a pattern is found in a text.

    Raises:
        RequestError: The pattern is too long, takes too much time or memory, or is not valid.
    """
    _check(pattern)
    return _of_python(pattern) if _LIBRARY is None else _of_library(pattern, _LIBRARY)


def _check(pattern: str) -> None:
    encoded = pattern.encode()
    if len(encoded) > MAX_PATTERN_BYTES:
        raise RequestError(f"the filter has {len(encoded)} bytes; at most {MAX_PATTERN_BYTES} are accepted")
    plain = _BRACKETS.sub("x", pattern)
    if re.search(r"\\[1-9]", plain):
        raise RequestError(f"the filter {quoted(pattern)} contains a back-reference; they are not accepted")
    product = 1
    for low, high in _REPETITION.findall(plain):
        for digits in (low, high):
            if len(digits) > 4:
                raise RequestError(f"the filter {quoted(pattern)} repeats too often; at most {MAX_REPETITIONS} times")
        product *= max(int(high or 0), int(low or 0), 1)
    if product > MAX_REPETITIONS:
        raise RequestError(
            f"the filter {quoted(pattern)} repeats up to {product} times; at most {MAX_REPETITIONS} are accepted"
        )


def _library() -> ctypes.CDLL | None:
    if sys.platform == "win32":
        return None
    try:
        library = ctypes.CDLL(None)
        library.regcomp.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int)
        library.regexec.argtypes = (
            ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_int,
        )  # fmt: skip
        library.regerror.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t)
        library.regfree.argtypes = (ctypes.c_void_p,)
        library.regfree.restype = None
    except (AttributeError, OSError):
        return None
    return library


_LIBRARY = _library()


class _Compiled:
    """A pattern, compiled by the C library."""

    def __init__(self, pattern: str, library: ctypes.CDLL) -> None:
        self._library = library
        self._regex = ctypes.create_string_buffer(_REGEX_BYTES)
        error = library.regcomp(self._regex, pattern.encode(), _EXTENDED | _NOSUB)
        if error:
            text = ctypes.create_string_buffer(200)
            library.regerror(error, self._regex, text, len(text))
            reason = text.value.decode(errors="replace")
            raise RequestError(f"the filter {quoted(pattern)} is not a POSIX extended regular expression: {reason}")
        self._open = True

    def __call__(self, text: str) -> bool:
        return bool(self._library.regexec(self._regex, text.encode(), 0, None, 0) == 0)

    def __del__(self) -> None:
        if getattr(self, "_open", False):
            self._library.regfree(self._regex)


def _of_library(pattern: str, library: ctypes.CDLL) -> Search:
    return _Compiled(pattern, library)


def _repeats_choices(plain: str) -> bool:
    """Returns whether a group is repeated that itself repeats something or has alternatives."""
    open_groups: list[bool] = []
    for index, character in enumerate(plain):
        if character == "(":
            open_groups.append(False)
        elif character == ")" and open_groups:
            chooses = open_groups.pop()
            repeated = plain[index + 1 : index + 2] in tuple("*+?{")
            if chooses and repeated:
                return True
            if open_groups:
                open_groups[-1] |= chooses or repeated
        elif character in "*+?{|" and open_groups:
            open_groups[-1] = True
    return False


def _of_python(pattern: str) -> Search:
    """The same for systems whose C library has no regular expressions."""
    plain = _BRACKETS.sub("x", pattern)
    if _repeats_choices(re.sub(r"\\.", "x", plain)):
        raise RequestError(f"the filter {quoted(pattern)} repeats a group that repeats or has alternatives")
    translated = re.sub(r"\[:(\w+):\]", lambda match: _CLASSES.get(match[1], match[0]), pattern)
    try:
        compiled = re.compile(translated)
    except re.error as error:
        raise RequestError(f"the filter {quoted(pattern)} is not valid: {error}") from None
    return lambda text: compiled.search(text) is not None
