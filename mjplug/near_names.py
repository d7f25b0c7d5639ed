"""Finds the name that the user probably meant, in a time that hardly depends on the number of names."""

import difflib
from bisect import bisect_left
from collections.abc import Iterable

MAX_NAME_LENGTH = 100
"""Maximum length of a wrong name for which a similar name is searched, and which error messages show in full
[characters]."""

_MIN_SIMILARITY = 0.6
"""Minimum share of common characters of similar names; difflib's default."""

_MAX_NEIGHBOURS = 6
"""Maximum number of neighbours that are compared, on each side and in both orders."""

_MAX_DIFFLIB_NAMES = 4
"""Maximum number of names that are compared with difflib, which takes up to a millisecond for long names."""

_MAX_DIFFLIB_PRODUCT = 2000
"""Maximum product of the lengths of two names that are compared with difflib."""


class Names:
    """Sorted names, in which a similar name is found without comparing all of them.

    A wrong name is compared with its neighbours in alphabetical order and in the alphabetical order of the reversed
    names, because a name with one mistake has the same beginning or the same end.

    Args:
        names: The names; empty names are ignored.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = sorted({name for name in names if name})
        self._forward = sorted((name.casefold(), name) for name in self._names)
        self._backward = sorted((name.casefold()[::-1], name) for name in self._names)

    def __len__(self) -> int:
        return len(self._names)

    def first(self, count: int) -> list[str]:
        """Returns at most `count` names, the first in alphabetical order."""
        return self._names[:count]

    def nearest(self, name: str) -> str | None:
        """Returns the name most similar to a wrong one; None if no name is similar or `name` is too long."""
        if not name or len(name) > MAX_NAME_LENGTH:
            return None
        searched = name.casefold()
        candidates: set[str] = set()
        for keys, text in ((self._forward, searched), (self._backward, searched[::-1])):
            # Also without the last character: that name sorts before the many names with the same beginning.
            candidates.update(_neighbours(keys, text), _neighbours(keys, text[:-1]))
        rated = sorted(
            ((_similarity(searched, other.casefold()), other) for other in candidates), key=lambda r: (-r[0], r[1])
        )
        if rated and rated[0][0] >= _MIN_SIMILARITY:
            return rated[0][1]
        matcher = difflib.SequenceMatcher(b=searched)
        best: tuple[float, str] = (_MIN_SIMILARITY, "")
        for _, other in rated[:_MAX_DIFFLIB_NAMES]:
            if len(other) * len(searched) <= _MAX_DIFFLIB_PRODUCT:
                matcher.set_seq1(other.casefold())
                best = max(best, (matcher.ratio(), other))
        return best[1] or None


def _neighbours(keys: list[tuple[str, str]], searched: str) -> list[str]:
    at = bisect_left(keys, (searched, ""))
    return [name for _, name in keys[max(0, at - _MAX_NEIGHBOURS) : at + _MAX_NEIGHBOURS]]


def _similarity(a: str, b: str) -> float:
    """Returns the share of characters in the common beginning and the common end of two names, 0 to 1."""
    shorter = min(len(a), len(b))
    begin = 0
    while begin < shorter and a[begin] == b[begin]:
        begin += 1
    end = 0
    while end < shorter - begin and a[-1 - end] == b[-1 - end]:
        end += 1
    return 2.0 * (begin + end) / (len(a) + len(b))
