"""Selects the interfaces to map, and determines their ROS names."""

import re
from dataclasses import dataclass, field
from re import Pattern

CLOCK = "/clock"

_TOKEN = r"(?!.*__)[A-Za-z_][A-Za-z0-9_]*"
_FULL_NAME = re.compile(rf"(?:/{_TOKEN})+")


def is_full_name(name: str) -> bool:
    """Returns whether a text is a full ROS name, such as `/robot1/scan`."""
    return _FULL_NAME.fullmatch(name) is not None


@dataclass(frozen=True)
class Naming:
    """Rules that map the server's names to ROS names.

    Attributes:
        allow: Only names that fully match one of these patterns are mapped.
        deny: Names that fully match one of these patterns are not mapped.
        namespace: Prefix of the ROS names, such as `/robot1`; empty: no prefix.
        remap: New names by the server's names; they get no prefix.
    """

    allow: tuple[Pattern[str], ...] = (re.compile(".*"),)
    deny: tuple[Pattern[str], ...] = ()
    namespace: str = ""
    remap: dict[str, str] = field(default_factory=dict)

    def ros_name(self, name: str) -> str | None:
        """Returns the ROS name of an interface; None if the interface is not mapped.

        Args:
            name: Full name of the interface in the server.
        """
        if not _matches(self.allow, name) or _matches(self.deny, name):
            return None
        # ROS nodes subscribe to `/clock` in every namespace.
        return self.remap.get(name, name if name == CLOCK else f"{self.namespace}{name}")


def _matches(patterns: tuple[Pattern[str], ...], name: str) -> bool:
    return any(pattern.fullmatch(name) for pattern in patterns)
