"""A configuration file that says what a ROS parameter file says."""

from mjplug.cli.yaml_text import block
from mjplug.config.draft import Draft
from mjplug.config.settings import Settings


def converted(draft: Draft, settings: Settings) -> str:
    """Returns the file's text: the settings that are not defaults, and the plugins with the parameters that are given.

    Args:
        draft: What was read.
        settings: What it means.
    """
    given = settings.model_dump(exclude_defaults=True, exclude={"plugins", "ros_params"})
    plugins = {name: {"type": entry.type, **entry.parameters} for name, entry in draft.plugins.items()}
    return "\n".join(block({**given, "plugins": plugins}))
