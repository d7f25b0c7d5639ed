"""Checks whether cameras can render, and with which OpenGL backend."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping

from mjplug.cli.doctor.finding import Finding

_TOPIC = "graphics"
_RENDER_TIMEOUT = 60.0
"""Time limit of one attempt [s]; software rendering compiles its shaders for one to two seconds."""

_PACKAGES = {
    "glfw": "needs a display, and: apt-get install libgl1 libglfw3",
    "egl": "apt-get install libegl1 libgl1",
    "osmesa": "apt-get install libosmesa6",
}
"""MuJoCo's backends, and the packages that they need on Debian and Ubuntu."""

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")

_NO_DISPLAY = "no display"

Draw = Callable[[str], tuple[bool, str]]
"""Tests a backend; returns whether it works, and the name of the renderer or the reason for the failure."""


def draw(backend: str) -> tuple[bool, str]:
    """Renders an image with a backend, in a separate process."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "mjplug.cli.doctor.drawing", backend],
            capture_output=True,
            text=True,
            timeout=_RENDER_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no image within {_RENDER_TIMEOUT:g} s"
    if done.returncode == 0:
        return True, done.stdout.strip().splitlines()[-1]
    if done.returncode < 0:
        return False, f"the process crashed (signal {-done.returncode})"
    return False, (done.stderr.strip().splitlines() or ["no reason given"])[-1]


def check_graphics(
    environ: Mapping[str, str] = os.environ, try_backend: Draw = draw, platform: str = sys.platform
) -> Iterator[Finding]:
    """Yields findings about rendering without a window.

    Args:
        environ: The environment variables.
        try_backend: Tests one backend.
        platform: As `sys.platform`.
    """
    display = bool(environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY")) or platform != "linux"
    order = ["glfw", "egl", "osmesa"] if display else ["egl", "osmesa", "glfw"]
    backends = order if platform == "linux" else ["glfw"]
    chosen = environ.get("MUJOCO_GL", "").strip().lower()
    working: list[str] = []
    for backend in backends:
        works, detail = (False, _NO_DISPLAY) if backend == "glfw" and not display else try_backend(backend)
        if works:
            software = any(word in detail.lower() for word in _SOFTWARE)
            first = "cameras render with it" if not working else "works too"
            slow = " (software rendering; a GPU would be much faster)" if software else ""
            yield Finding(_TOPIC, "note" if software else "ok", f"{backend}: {first}: {detail}{slow}")
            working.append(backend)
        else:
            fix = "" if detail == _NO_DISPLAY else _PACKAGES[backend]
            yield Finding(_TOPIC, "note", f"{backend}: does not work: {detail}", fix)
    if not working:
        yield Finding(
            _TOPIC,
            "warning",
            "no OpenGL backend works: cameras are disabled, everything else works",
            "apt-get install libegl1 libgl1",
        )
    if chosen and chosen not in working:
        yield Finding(
            _TOPIC,
            "error" if working else "warning",
            f"MUJOCO_GL={chosen} does not work on this machine",
            f"export MUJOCO_GL={working[0]}, or unset MUJOCO_GL" if working else "unset MUJOCO_GL",
        )
