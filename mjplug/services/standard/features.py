"""What the server supports, as the standard interface reports it."""

from mjplug.config.standard_settings import StandardSettings
from mjplug_schemas.simulation_interfaces import SimulatorFeatures as F

ALWAYS = (
    F.NAMED_POSES,
    F.POSE_BOUNDS,
    F.ENTITY_TAGS,
    F.ENTITY_BOUNDS,
    F.ENTITY_BOUNDS_BOX,
    F.ENTITY_CATEGORIES,
    F.ENTITY_STATE_GETTING,
    F.ENTITY_STATE_SETTING,
    F.ENTITY_INFO_GETTING,
    F.ENTITY_INFO_SETTING,
    F.SIMULATION_RESET,
    F.SIMULATION_RESET_TIME,
    F.SIMULATION_RESET_STATE,
    F.SIMULATION_STATE_GETTING,
    F.SIMULATION_STATE_SETTING,
    F.SIMULATION_STATE_PAUSE,
    F.STEP_SIMULATION_SINGLE,
    F.STEP_SIMULATION_MULTIPLE,
    F.WORLD_INFO_GETTING,
)
"""The features that do not depend on the configuration."""

_LIMITS = (
    "bounds are boxes that may be larger than necessary; their first point is the upper right corner",
    "filters by convex hulls are not supported",
    "a regular expression is found anywhere in the name",
    "accelerations are those at the beginning of the last step and cannot be set",
    "STOPPED resets everything and pauses; PAUSED can be entered from STOPPED",
)


class Features:
    """The features of a server.

    Args:
        settings: The setting `simulation_interfaces`.
    """

    def __init__(self, settings: StandardSettings) -> None:
        quitting = (
            "the state QUITTING ends the server" if settings.allow_quit else "the state QUITTING is not supported"
        )
        self._info = "; ".join((*_LIMITS, quitting))

    def message(self) -> F:
        """Returns the features as a message."""
        return F(features=tuple(sorted(ALWAYS)), spawn_formats=(), custom_info=self._info)
