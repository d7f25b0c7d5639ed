"""Quality of service as ros2 writes it on the command line, and what of it a subscriber on Zenoh can choose."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import typer

Profile = Literal[
    "unknown", "default", "system_default", "sensor_data", "services_default", "parameters", "parameter_events",
    "action_status_default", "best_available",
]  # fmt: skip
Durability = Literal["system_default", "transient_local", "volatile", "unknown", "best_available"]

QosProfile = Annotated[
    Profile | None, typer.Option("--qos-profile", help="A profile of ROS 2. By default, what the topic offers.")
]
QosDepth = Annotated[
    int | None, typer.Option("--qos-depth", min=0, metavar="N", help="How many messages may wait to be shown.")
]
QosHistory = Annotated[
    Literal["system_default", "keep_last", "keep_all", "unknown"] | None,
    typer.Option("--qos-history", help="keep_all lets any number of messages wait."),
]
QosReliability = Annotated[
    Literal["system_default", "reliable", "best_effort", "unknown", "best_available"] | None,
    typer.Option("--qos-reliability", help="Accepted as by ros2; on Zenoh, the publisher decides."),
]
QosDurability = Annotated[
    Durability | None,
    typer.Option("--qos-durability", help="volatile leaves out what was published before."),
]

_PROFILES: Final[dict[str, tuple[int, Durability]]] = {
    "default": (10, "volatile"),
    "sensor_data": (5, "volatile"),
    "services_default": (10, "volatile"),
    "parameters": (1000, "volatile"),
    "parameter_events": (1000, "volatile"),
    "action_status_default": (1, "transient_local"),
}
"""Depth and durability of the profiles that say anything about them."""

_ALL = 1_000_000
"""What `keep_all` keeps: more than a terminal ever shows."""


@dataclass(frozen=True, slots=True)
class Qos:
    """What a subscriber has chosen.

    Attributes:
        depth: How many messages may wait to be shown; None is not chosen.
        durability: Whether it wants what was published before; None is as the topic offers.
    """

    depth: int | None
    durability: Durability | None

    def history(self, default: int) -> int | None:
        """Returns how many messages that were published before to ask for; None is as many as the topic keeps.

        Args:
            default: How many, if `transient_local` is chosen without a depth.
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
    """Returns what options of the command line choose; each counts more than the profile.

    Args:
        profile: The name of a profile.
        depth: How many messages may wait; 0 is not chosen, as for ros2.
        history: `keep_all` lets any number wait.
        reliability: Has no effect: with Zenoh, the publisher decides it, and every subscriber gets what it sends.
        durability: Whether to get what was published before.
    """
    depth_of_profile, durability_of_profile = _PROFILES.get(profile or "", (None, None))
    chosen = durability if durability in ("volatile", "transient_local") else durability_of_profile
    return Qos(_ALL if history == "keep_all" else depth or depth_of_profile, chosen)
