"""`mjplug view --window`: MuJoCo's own viewer, fed with the states of a server."""

from mjplug.window.errors import WindowError
from mjplug.window.run import run_window

__all__ = ["WindowError", "run_window"]
