"""Finds an OpenGL that works on this machine. MuJoCo itself draws; this makes the context it draws in."""

import importlib
import logging
import os
import sys
import warnings
from collections.abc import Mapping
from typing import Any

from mjplug.plugin import UnavailableError

BACKEND = "CAMERA_OPENGL"
"""The environment variable that tells the process which way to go. Not `MUJOCO_GL`: with that, importing MuJoCo fails
where the library is missing, before anybody could say what to install."""

_CHOICE = "MUJOCO_GL"

_NAMES = {"egl": "EGL", "osmesa": "OSMesa", "glfw": "GLFW"}

_REMEDIES = {
    "egl": "apt-get install libegl1 libgl1",
    "osmesa": "apt-get install libosmesa6",
    "glfw": "it needs a display, and apt-get install libgl1",
}

_DEFAULT = ("", "enable", "enabled", "on", "true", "1", "glx", "cgl", "wgl")
"""What MuJoCo takes besides, for the platform's usual way."""

_OFF = ("disable", "disabled", "off", "false", "0")

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "gdi generic", "basic render")


def environments(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> tuple[dict[str, str], ...]:
    """Returns the environments to try, the best one first.

    Args:
        environment: The user's own; a choice in it is the only one tried.
        platform: As `sys.platform`.
    """
    if chosen := environment.get(_CHOICE, "").strip().lower():
        backends = [chosen]
    elif platform != "linux":
        backends = [""]
    else:
        display = environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
        backends = ["glfw", "egl", "osmesa"] if display else ["egl", "osmesa"]
    # PyOpenGL's own variable could contradict.
    return tuple({BACKEND: backend, _CHOICE: "", "PYOPENGL_PLATFORM": ""} for backend in backends)


class GlContext:
    """An OpenGL context without a window, current in the thread that made it.

    Attributes:
        backend: How it was made, such as `EGL`.
        renderer: What draws, as the driver says: `llvmpipe (LLVM 15.0.6, 256 bits)`.

    Args:
        width: Of the largest image [pixels].
        height: Likewise.

    Raises:
        UnavailableError: There is none; the sentence says what to install.
    """

    def __init__(self, width: int, height: int) -> None:
        chosen = os.environ.get(BACKEND, "")
        self.backend = _NAMES.get(chosen, "OpenGL")
        self._context: Any = None
        if chosen in _OFF:
            raise UnavailableError(f"rendering is switched off by {_CHOICE}={chosen}")
        if chosen not in (*_NAMES, *_DEFAULT):
            raise UnavailableError(f"{_CHOICE} is {chosen!r}; it can be {', '.join(_NAMES)} or disable")
        # It tells of an accelerator that is missing, and of no use here.
        logging.getLogger("OpenGL").setLevel(logging.WARNING)
        # GLFW only warns, and goes on without a context.
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                module = importlib.import_module(f"mujoco.{chosen}" if chosen in _NAMES else "mujoco")
                self._context = module.GLContext(width, height)
                self._context.make_current()
                gl = importlib.import_module("OpenGL.GL")
                self.renderer = (gl.glGetString(gl.GL_RENDERER) or b"").decode(errors="replace")
            except Exception as error:
                # Missing libraries show as AttributeError, ImportError, ctypes.ArgumentError and others.
                self.close()
                raise unavailable(error) from error
        if not self.renderer:
            self.close()
            raise unavailable(warned[0].message if warned else "the driver does not answer")

    @property
    def in_software(self) -> bool:
        """Whether the processor draws, for want of a graphics card or its driver."""
        return any(word in self.renderer.lower() for word in _SOFTWARE)

    def make_current(self) -> None:
        """Makes it the thread's context, in case somebody else's took its place."""
        self._context.make_current()

    def close(self) -> None:
        """Frees it; a second call does nothing."""
        if self._context is not None:
            self._context.free()
            self._context = None


def unavailable(reason: object) -> UnavailableError:
    """Returns the error that says why the chosen way to OpenGL is closed, and what would open it."""
    chosen = os.environ.get(BACKEND, "")
    said = f"{type(reason).__name__}: {reason}" if isinstance(reason, Exception) else str(reason)
    said = " ".join(said.split()).rstrip(".")
    remedy = f" ({_REMEDIES[chosen]})" if chosen in _REMEDIES else ""
    return UnavailableError(f"no OpenGL through {_NAMES.get(chosen, chosen or 'the default')}{remedy}: {said}")
