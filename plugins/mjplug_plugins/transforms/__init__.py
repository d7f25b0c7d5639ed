"""Publishes frames of the model as transforms."""

from mjplug_plugins.transforms.plugin import Transforms as Transforms
