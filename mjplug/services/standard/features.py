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
    F.STEP_SIMULATION_ACTION,
    F.WORLD_INFO_GETTING,
)
"""The features that do not depend on the configuration."""

SPAWNING = (
    F.SPAWNING,
    F.DELETING,
    F.SPAWNING_RESOURCE_STRING,
    F.SPAWNABLES,
    F.SPAWNING_ENTITIES,
    F.SIMULATION_RESET_SPAWNED,
)
"""The features that need a model that MuJoCo can compile again."""

_SPAWN_LIMITS = (
    "adding or removing an entity compiles the model again, which may change the last bits of other trajectories",
    "a model without a free joint is spawned as a mocap body, so that it can be moved",
    "entity_namespace has no effect",
)

_LIMITS = (
    "bounds are boxes that may be larger than necessary; their first point is the upper right corner",
    "filters by convex hulls are not supported",
    "a regular expression is found anywhere in the name",
    "accelerations are those at the beginning of the last step and cannot be set",
    "simulate_steps reports each of up to 1000 steps, and otherwise every 10 ms",
    "STOPPED resets everything and pauses; PAUSED can be entered from STOPPED",
)


class Features:
    """The features of a server.

    Args:
        settings: The setting `simulation_interfaces`.
        spawning: Whether entities can be added and removed.
    """

    def __init__(self, settings: StandardSettings, spawning: bool) -> None:
        self._features = sorted((*ALWAYS, *(SPAWNING if spawning else ())))
        self._formats = ("mjcf", "urdf") if spawning else ()
        quitting = (
            "the state QUITTING ends the server" if settings.allow_quit else "the state QUITTING is not supported"
        )
        limits = (*_LIMITS, *(_SPAWN_LIMITS if spawning else ()))
        self._info = "; ".join((*limits, quitting))

    def message(self) -> F:
        """Returns the features as a message."""
        return F(features=tuple(self._features), spawn_formats=self._formats, custom_info=self._info)
