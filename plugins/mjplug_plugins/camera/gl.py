"""Creates an OpenGL context with a backend that works on this machine. MuJoCo renders into this context."""

import importlib
import logging
import os
import sys
import warnings
from collections.abc import Mapping
from typing import Any

from mjplug.plugin import UnavailableError

BACKEND_VARIABLE = "CAMERA_OPENGL"
"""Environment variable that selects the backend in the worker process. Not `MUJOCO_GL`: with it, MuJoCo
cannot be imported if the library is missing, so no error could name the package to install."""

_USER_VARIABLE = "MUJOCO_GL"

_NAMES = {"egl": "EGL", "osmesa": "OSMesa", "glfw": "GLFW"}

_REMEDIES = {
    "egl": "apt-get install libegl1 libgl1",
    "osmesa": "apt-get install libosmesa6",
    "glfw": "it needs a display, and apt-get install libgl1",
}

_DEFAULT = ("", "enable", "enabled", "on", "true", "1", "glx", "cgl", "wgl")
"""Other values of `MUJOCO_GL` that MuJoCo accepts; they select the default of the platform."""

_OFF = ("disable", "disabled", "off", "false", "0")

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "gdi generic", "basic render")


def environments(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> tuple[dict[str, str], ...]:
    """Returns the environment variables to try, the best backend first.

    Args:
        environment: The environment of the user; if it sets `MUJOCO_GL`, only that backend is tried.
        platform: The platform, a value of `sys.platform`.
    """
    if chosen := environment.get(_USER_VARIABLE, "").strip().lower():
        backends = [chosen]
    elif platform != "linux":
        backends = [""]
    else:
        display = environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
        backends = ["glfw", "egl", "osmesa"] if display else ["egl", "osmesa"]
    # PyOpenGL's variable could select another backend.
    return tuple({BACKEND_VARIABLE: backend, _USER_VARIABLE: "", "PYOPENGL_PLATFORM": ""} for backend in backends)


class GlContext:
    """An OpenGL context without a window, current in the thread that created it.

    Attributes:
        backend: Name of the backend, such as `EGL`.
        renderer: Name of the renderer as the driver reports it, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.

    Args:
        width: Width of the largest image [pixels].
        height: Height of the largest image [pixels].

    Raises:
        UnavailableError: OpenGL does not work; the message says what to install.
    """

    def __init__(self, width: int, height: int) -> None:
        chosen = os.environ.get(BACKEND_VARIABLE, "")
        self.backend = _NAMES.get(chosen, "OpenGL")
        self._context: Any = None
        if chosen in _OFF:
            raise UnavailableError(f"rendering is disabled by {_USER_VARIABLE}={chosen}")
        if chosen not in (*_NAMES, *_DEFAULT):
            raise UnavailableError(f"{_USER_VARIABLE} is {chosen!r}; allowed: {', '.join(_NAMES)}, disable")
        # PyOpenGL logs that its accelerator module is missing; it is not needed here.
        logging.getLogger("OpenGL").setLevel(logging.WARNING)
        # If GLFW cannot create a context, it only warns.
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                module = importlib.import_module(f"mujoco.{chosen}" if chosen in _NAMES else "mujoco")
                self._context = module.GLContext(width, height)
                self._context.make_current()
                gl = importlib.import_module("OpenGL.GL")
                self.renderer = (gl.glGetString(gl.GL_RENDERER) or b"").decode(errors="replace")
            except Exception as error:
                # Missing libraries cause AttributeError, ImportError, ctypes.ArgumentError and others.
                self.close()
                raise unavailable(error) from error
        if not self.renderer:
            self.close()
            raise unavailable(warned[0].message if warned else "the driver reports no renderer")

    @property
    def in_software(self) -> bool:
        """Whether rendering is done in software, because there is no GPU or no driver for it."""
        return any(word in self.renderer.lower() for word in _SOFTWARE)

    def make_current(self) -> None:
        """Makes this context current again, in case another context was made current."""
        self._context.make_current()

    def close(self) -> None:
        """Frees the context; a second call does nothing."""
        if self._context is not None:
            self._context.free()
            self._context = None


def unavailable(reason: object) -> UnavailableError:
    """Returns an error with the reason why the selected backend failed and the package to install."""
    chosen = os.environ.get(BACKEND_VARIABLE, "")
    text = f"{type(reason).__name__}: {reason}" if isinstance(reason, Exception) else str(reason)
    text = " ".join(text.split()).rstrip(".")
    remedy = f" ({_REMEDIES[chosen]})" if chosen in _REMEDIES else ""
    return UnavailableError(f"no OpenGL through {_NAMES.get(chosen, chosen or 'the default')}{remedy}: {text}")
