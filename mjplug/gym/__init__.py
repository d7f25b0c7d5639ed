"""Environments of gymnasium for servers. Needs the extra: `pip install "mjplug[gym]"`.

Importing this package registers the tasks `mjplug/ArmReach-v0` and `mjplug/QuadrupedStand-v0`:

    import gymnasium
    import mjplug.gym

    env = gymnasium.make("mjplug/ArmReach-v0")
"""

from mjplug.gym.env import MjplugEnv
from mjplug.gym.registration import register_tasks

__all__ = ["MjplugEnv", "register_tasks"]

register_tasks()
