"""Applies forces and torques to bodies for a duration of simulated time, on request."""

from mjplug_plugins.external_wrench.plugin import ExternalWrench

__all__ = ["ExternalWrench"]
