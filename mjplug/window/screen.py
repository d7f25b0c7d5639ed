"""Checks whether this process can open a window, because MuJoCo's viewers end the process if it cannot."""

import sys
from collections.abc import Mapping
from importlib import import_module

from mjplug.window.errors import WindowError


def check_screen(environment: Mapping[str, str], platform: str = sys.platform) -> None:
    """Checks that there is a screen.

    Args:
        environment: The environment variables of the process.
        platform: As `sys.platform`.

    Raises:
        WindowError: There is none, or the process cannot use it.
    """
    if platform == "darwin":
        # MuJoCo's launcher replaces this variable of its module.
        if import_module("mujoco.viewer")._MJPYTHON is None:
            raise WindowError(
                "on macOS, a window needs MuJoCo's own Python: mjpython -m mjplug view --window; "
                "`mjplug view` without --window shows the simulation in a browser"
            )
    elif platform != "win32" and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise WindowError(
            "there is no screen for a window: neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "`mjplug view` without --window shows the simulation in a browser, also from another machine"
        )
