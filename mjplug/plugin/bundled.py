"""Helpers that the bundled plugins share. They are not part of the public plugin API and may change at any time."""

from mjplug.errors import quoted
from mjplug.model.actuator_law import ActuatorLaw, Drives, actuator_law
from mjplug.model.lidar_extension import LidarSensor, lidar_sensors
from mjplug.physics.memory import float_view
from mjplug.plugin.model_names import object_names, ros_tokens

__all__ = [
    "ActuatorLaw",
    "Drives",
    "LidarSensor",
    "actuator_law",
    "float_view",
    "lidar_sensors",
    "object_names",
    "quoted",
    "ros_tokens",
]
