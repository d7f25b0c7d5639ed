"""Converts a URDF or xacro file to an MJCF model that stands, moves and reports."""
