"""Pushes and turns bodies for a span of simulated time, on request."""

from mjplug_plugins.external_wrench.plugin import ExternalWrench

__all__ = ["ExternalWrench"]
