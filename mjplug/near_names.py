"""Finds the name that was probably meant, in a time that hardly depends on how many names there are."""

import difflib
from bisect import bisect_left
from collections.abc import Iterable

LONGEST = 100
"""Characters up to which the nearest name of a wrong one is looked for."""

_CLOSE = 0.6
"""Share of characters in common from which a name counts as near; difflib's default."""

_NEIGHBOURS = 6
"""Names on each side, in both orders, that are compared."""

_CLOSELY = 4
"""Names that are compared with difflib, which takes up to a millisecond for long ones."""

_LONGEST_PRODUCT = 2000
"""Product of two lengths up to which difflib compares."""


class Names:
    """Names in order, in which a near one is found without looking at all of them.

    A wrong name is compared with its neighbours in the order of the names, and in the order of the names read
    backwards: a name with one mistake has the same beginning or the same end.

    Args:
        names: The names; empty ones are left out.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = sorted({name for name in names if name})
        self._forward = sorted((name.casefold(), name) for name in self._names)
        self._backward = sorted((name.casefold()[::-1], name) for name in self._names)

    def __len__(self) -> int:
        return len(self._names)

    def first(self, count: int) -> list[str]:
        """Returns the first names in alphabetical order, at most `count`."""
        return self._names[:count]

    def nearest(self, name: str) -> str | None:
        """Returns the name that is most like a wrong one; None if none is like it, or if it is absurdly long."""
        if not name or len(name) > LONGEST:
            return None
        wanted = name.casefold()
        candidates: set[str] = set()
        for keys, text in ((self._forward, wanted), (self._backward, wanted[::-1])):
            # Without its last character too: what stands right before the many names that begin like a wrong one.
            candidates.update(_around(keys, text), _around(keys, text[:-1]))
        rated = sorted(((_alike(wanted, other.casefold()), other) for other in candidates), key=lambda r: (-r[0], r[1]))
        if rated and rated[0][0] >= _CLOSE:
            return rated[0][1]
        matcher = difflib.SequenceMatcher(b=wanted)
        best: tuple[float, str] = (_CLOSE, "")
        for _, other in rated[:_CLOSELY]:
            if len(other) * len(wanted) <= _LONGEST_PRODUCT:
                matcher.set_seq1(other.casefold())
                best = max(best, (matcher.ratio(), other))
        return best[1] or None


def _around(keys: list[tuple[str, str]], wanted: str) -> list[str]:
    at = bisect_left(keys, (wanted, ""))
    return [name for _, name in keys[max(0, at - _NEIGHBOURS) : at + _NEIGHBOURS]]


def _alike(a: str, b: str) -> float:
    """Returns the share of characters in the common beginning and the common end."""
    shorter = min(len(a), len(b))
    begin = 0
    while begin < shorter and a[begin] == b[begin]:
        begin += 1
    end = 0
    while end < shorter - begin and a[-1 - end] == b[-1 - end]:
        end += 1
    return 2.0 * (begin + end) / (len(a) + len(b))
