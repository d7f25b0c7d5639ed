"""Casts lidar rays in a worker process and publishes laser scans and point clouds."""

from mjplug_plugins.lidar.plugin import Lidar

__all__ = ["Lidar"]
