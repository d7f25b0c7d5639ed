"""Publishes the state of joints with one degree of freedom, and executes joint commands."""

from mjplug_plugins.joints.commands import JointCommands as JointCommands
from mjplug_plugins.joints.state_publisher import JointStatePublisher as JointStatePublisher
