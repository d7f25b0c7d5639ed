"""The public plugin API: what a plugin is, and what it may use of the server."""

from mjplug.plugin.host import Host
from mjplug.plugin.plugin import Parameters, Plugin

__all__ = ["Host", "Parameters", "Plugin"]
