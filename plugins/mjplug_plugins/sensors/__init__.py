"""Publishes the sensors of the model as ROS messages."""

from mjplug_plugins.sensors.plugin import Sensors as Sensors
