"""Saved states: services that save the simulation with its plugins, and restore it bit by bit."""
