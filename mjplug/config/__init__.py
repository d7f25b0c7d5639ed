"""Configuration files: reading them, checking them, and naming what is wrong and where."""
