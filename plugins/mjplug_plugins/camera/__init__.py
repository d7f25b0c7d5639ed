"""Publishes the cameras of the model: colour, depth and intrinsics."""

from mjplug_plugins.camera.plugin import Camera

__all__ = ["Camera"]
