"""Which interfaces are mapped, and what they are called in ROS."""

import re
from dataclasses import dataclass, field
from re import Pattern

CLOCK = "/clock"

_TOKEN = r"(?!.*__)[A-Za-z_][A-Za-z0-9_]*"
_FULL_NAME = re.compile(rf"(?:/{_TOKEN})+")


def is_full_name(name: str) -> bool:
    """Whether a text is a full ROS name, such as `/robot1/scan`."""
    return _FULL_NAME.fullmatch(name) is not None


@dataclass(frozen=True)
class Naming:
    """Rules that lead from the server's names to those in ROS.

    Attributes:
        allow: Only names that one of these matches as a whole are mapped.
        deny: Names that one of these matches as a whole are not.
        namespace: What names begin with in ROS, such as `/robot1`; empty for nothing.
        remap: What to call names instead; no namespace is added to these.
    """

    allow: tuple[Pattern[str], ...] = (re.compile(".*"),)
    deny: tuple[Pattern[str], ...] = ()
    namespace: str = ""
    remap: dict[str, str] = field(default_factory=dict)

    def ros_name(self, name: str) -> str | None:
        """Returns what an interface is called in ROS; None if it is not to be mapped.

        Args:
            name: The server's full name for it.
        """
        if not _matches(self.allow, name) or _matches(self.deny, name):
            return None
        # All nodes look for the clock in one place, whatever their namespace.
        return self.remap.get(name, name if name == CLOCK else f"{self.namespace}{name}")


def _matches(patterns: tuple[Pattern[str], ...], name: str) -> bool:
    return any(pattern.fullmatch(name) for pattern in patterns)
