"""Joints with one degree of freedom: their state as messages, and commands that move them."""

from mjplug_plugins.joints.commands import JointCommands as JointCommands
from mjplug_plugins.joints.state_publisher import JointStatePublisher as JointStatePublisher
