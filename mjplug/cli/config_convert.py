"""Conversion of a ROS parameter file to a configuration file."""

from mjplug.cli.yaml_text import block
from mjplug.config.settings import Settings


def converted(settings: Settings) -> str:
    """Returns the file's text: the settings that are not defaults, and the plugins with the parameters that are given.

    Args:
        settings: The settings that were read from the ROS parameter file.
    """
    given = settings.model_dump(exclude_defaults=True, exclude={"plugins", "ros_params"})
    plugins = {
        name: {key: getattr(entry, key) for key in type(entry).model_fields if key in entry.model_fields_set}
        | entry.parameters
        for name, entry in settings.plugins.items()
    }
    return "\n".join(block({**given, "plugins": plugins}))
