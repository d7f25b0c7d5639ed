"""Whether cameras can draw, and through what."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping

from mjplug.cli.doctor.finding import Finding

_TOPIC = "graphics"
_RENDER_TIMEOUT = 60.0
"""How long one attempt may take [s]; software rendering compiles its shaders for a second or two."""

_PACKAGES = {
    "glfw": "needs a display, and: apt-get install libgl1 libglfw3",
    "egl": "apt-get install libegl1 libgl1",
    "osmesa": "apt-get install libosmesa6",
}
"""The backends that MuJoCo has, and what they need on Debian and Ubuntu."""

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")

_NO_DISPLAY = "there is no display"

Draw = Callable[[str], tuple[bool, str]]
"""Tries a backend; returns whether it works, and the renderer or the reason."""


def draw(backend: str) -> tuple[bool, str]:
    """Draws a picture through a backend, in a process of its own."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "mjplug.cli.doctor.drawing", backend],
            capture_output=True,
            text=True,
            timeout=_RENDER_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no picture within {_RENDER_TIMEOUT:g} s"
    if done.returncode == 0:
        return True, done.stdout.strip().splitlines()[-1]
    if done.returncode < 0:
        return False, f"the process crashed (signal {-done.returncode})"
    return False, (done.stderr.strip().splitlines() or ["no reason given"])[-1]


def check_graphics(
    environ: Mapping[str, str] = os.environ, try_backend: Draw = draw, platform: str = sys.platform
) -> Iterator[Finding]:
    """Yields what there is to say about drawing without a window.

    Args:
        environ: The environment variables.
        try_backend: Tries one backend.
        platform: As `sys.platform`.
    """
    display = bool(environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY")) or platform != "linux"
    order = ["glfw", "egl", "osmesa"] if display else ["egl", "osmesa", "glfw"]
    backends = order if platform == "linux" else ["glfw"]
    chosen = environ.get("MUJOCO_GL", "").strip().lower()
    working: list[str] = []
    for backend in backends:
        works, said = (False, _NO_DISPLAY) if backend == "glfw" and not display else try_backend(backend)
        if works:
            software = any(word in said.lower() for word in _SOFTWARE)
            first = "cameras draw through it" if not working else "works too"
            slow = ", in software: a graphics card would be far quicker" if software else ""
            yield Finding(_TOPIC, "note" if software else "ok", f"{backend}: {first}: {said}{slow}")
            working.append(backend)
        else:
            fix = "" if said == _NO_DISPLAY else _PACKAGES[backend]
            yield Finding(_TOPIC, "note", f"{backend}: does not work: {said}", fix)
    if not working:
        yield Finding(
            _TOPIC,
            "warning",
            "no OpenGL works: cameras are switched off, everything else runs",
            "apt-get install libegl1 libgl1",
        )
    if chosen and chosen not in working:
        yield Finding(
            _TOPIC,
            "error" if working else "warning",
            f"MUJOCO_GL={chosen} names no backend that works here",
            f"export MUJOCO_GL={working[0]}, or unset MUJOCO_GL" if working else "unset MUJOCO_GL",
        )
