"""Configuration files: reading, checking, and saying what is wrong with them, and where."""

from mjplug.config.load import Draft, Loaded, load, read
from mjplug.config.problem import Problem
from mjplug.config.settings import Settings

__all__ = ["Draft", "Loaded", "Problem", "Settings", "load", "read"]
