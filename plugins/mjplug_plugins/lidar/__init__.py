"""Casts lidar rays in a process of its own, and publishes them as laser scans and point clouds."""

from mjplug_plugins.lidar.plugin import Lidar

__all__ = ["Lidar"]
