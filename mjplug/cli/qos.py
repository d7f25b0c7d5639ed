"""The quality-of-service options of ros2, as far as a Zenoh subscriber can choose them."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import typer

Profile = Literal[
    "unknown", "default", "system_default", "sensor_data", "services_default", "parameters", "parameter_events",
    "action_status_default", "best_available",
]  # fmt: skip
Durability = Literal["system_default", "transient_local", "volatile", "unknown", "best_available"]

QosProfile = Annotated[
    Profile | None, typer.Option("--qos-profile", help="A QoS profile of ROS 2. Default: that of the topic.")
]
QosDepth = Annotated[
    int | None,
    typer.Option("--qos-depth", min=0, metavar="N", help="Maximum number of messages that wait to be shown."),
]
QosHistory = Annotated[
    Literal["system_default", "keep_last", "keep_all", "unknown"] | None,
    typer.Option("--qos-history", help="With keep_all, the number of waiting messages is not limited."),
]
QosReliability = Annotated[
    Literal["system_default", "reliable", "best_effort", "unknown", "best_available"] | None,
    typer.Option("--qos-reliability", help="No effect: with Zenoh, the publisher determines it."),
]
QosDurability = Annotated[
    Durability | None,
    typer.Option("--qos-durability", help="With volatile, earlier messages are not shown."),
]

_PROFILES: Final[dict[str, tuple[int, Durability]]] = {
    "default": (10, "volatile"),
    "sensor_data": (5, "volatile"),
    "services_default": (10, "volatile"),
    "parameters": (1000, "volatile"),
    "parameter_events": (1000, "volatile"),
    "action_status_default": (1, "transient_local"),
}
"""Depth and durability of the profiles that define them."""

_ALL = 1_000_000
"""Depth for `keep_all`: more than a terminal ever shows."""


@dataclass(frozen=True, slots=True)
class Qos:
    """The choice of a subscriber.

    Attributes:
        depth: Maximum number of messages that wait to be shown; None if not chosen.
        durability: Whether earlier messages are requested; None uses that of the topic.
    """

    depth: int | None
    durability: Durability | None

    def history(self, default: int) -> int | None:
        """Returns how many earlier messages to request; None requests as many as the topic keeps.

        Args:
            default: The number if `transient_local` is chosen without a depth.
        """
        if self.durability == "volatile":
            return 0
        return self.depth or default if self.durability == "transient_local" else None


def qos_of(
    profile: Profile | None,
    depth: int | None,
    history: str | None,
    reliability: str | None,
    durability: Durability | None,
) -> Qos:
    """Returns the choice from command line options; each option overrides the profile.

    Args:
        profile: The name of a profile.
        depth: Maximum number of waiting messages; 0 means not chosen, as for ros2.
        history: With `keep_all`, the number of waiting messages is not limited.
        reliability: No effect: with Zenoh, the publisher determines the reliability for all subscribers.
        durability: Whether earlier messages are requested.
    """
    depth_of_profile, durability_of_profile = _PROFILES.get(profile or "", (None, None))
    chosen = durability if durability in ("volatile", "transient_local") else durability_of_profile
    return Qos(_ALL if history == "keep_all" else depth or depth_of_profile, chosen)
