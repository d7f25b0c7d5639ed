"""Which topics are recorded; the rules of `ros2 bag record`."""

import re
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Selection:
    """A selection of topics.

    Attributes:
        all: Whether all topics are selected, except hidden ones.
        names: Full names of selected topics.
        regex: Topics are selected if it matches a part of their name; None for none.
        exclude: Topics are left out if it matches a part of their name, unless `names` contains them; None for none.
    """

    all: bool = False
    names: frozenset[str] = frozenset()
    regex: re.Pattern[str] | None = None
    exclude: re.Pattern[str] | None = None

    def __contains__(self, name: str) -> bool:
        if name in self.names:
            return True
        if self.exclude is not None and self.exclude.search(name):
            return False
        if self.regex is not None and self.regex.search(name):
            return True
        return self.all and not hidden(name)

    def missing(self, found: Iterable[str]) -> list[str]:
        """Returns the names that are selected but not among those that were found."""
        return sorted(self.names - frozenset(found))


def hidden(name: str) -> bool:
    """Returns whether a name is hidden in lists of ROS, such as those of actions: a part of it begins with `_`."""
    return any(part.startswith("_") for part in name.split("/"))
