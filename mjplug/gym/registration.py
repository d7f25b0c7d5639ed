"""The tasks that `gymnasium.make` finds."""

import gymnasium

NAMESPACE = "mjplug"


def register_tasks() -> None:
    """Registers the bundled tasks; a second call does nothing."""
    for name, entry_point, max_steps in (
        ("ArmReach-v0", "mjplug.gym.arm_reach:ArmReach", 200),
        ("QuadrupedStand-v0", "mjplug.gym.quadruped_stand:QuadrupedStand", 500),
    ):
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(id=f"{NAMESPACE}/{name}", entry_point=entry_point, max_episode_steps=max_steps)
