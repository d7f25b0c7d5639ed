"""Publishes the cameras of the model: colour images, depth images and intrinsics."""

from mjplug_plugins.camera.plugin import Camera

__all__ = ["Camera"]
