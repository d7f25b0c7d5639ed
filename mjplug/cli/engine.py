"""Imports MuJoCo quickly, and independently of MUJOCO_GL."""

import contextlib
import gc
import importlib
import os
import sys
from collections.abc import Iterator
from typing import Any

from mjplug.cli.interrupt import exit_on_interrupt

_BACKEND = "MUJOCO_GL"
_BLAS_THREADS = "OPENBLAS_NUM_THREADS"

_GL_CONTEXT = "mujoco.rendering.classic.gl_context"
"""MuJoCo's module that imports an OpenGL backend, and defines `GLContext`."""


def import_mujoco() -> None:
    """Imports MuJoCo without an OpenGL backend, which this process does not need.

    With MUJOCO_GL=egl or osmesa, and without their libraries, the import itself would fail; without MUJOCO_GL, it would
    load the window library GLFW. A plugin that renders in this process gets the backend when it asks for `GLContext`.

    NumPy, which is imported here too, is limited to one thread for linear algebra unless the user has chosen a number:
    its threads spin when they are created, and would slow physics down.
    """
    os.environ.setdefault(_BLAS_THREADS, "1")
    backend = os.environ.get(_BACKEND)
    os.environ[_BACKEND] = "disable"
    try:
        with exit_on_interrupt(), quick_imports():
            import mujoco
    finally:
        if backend is None:
            del os.environ[_BACKEND]
        else:
            os.environ[_BACKEND] = backend
    for module in (mujoco, sys.modules.get(_GL_CONTEXT)):
        if module is not None and "GLContext" not in vars(module):
            module.__dict__["__getattr__"] = _load_backend


@contextlib.contextmanager
def quick_imports() -> Iterator[None]:
    """Disables garbage collection during imports, which create many objects and little garbage."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _load_backend(name: str) -> Any:
    """Provides `GLContext` to MuJoCo's modules, for the backend that MUJOCO_GL names.

    Raises:
        AttributeError: The name is not `GLContext`, or rendering is disabled.
    """
    module = sys.modules.get(_GL_CONTEXT)
    if name == "GLContext" and module is not None:
        importlib.reload(module)
        if name in vars(module):
            sys.modules["mujoco"].__dict__[name] = vars(module)[name]
            return vars(module)[name]
    raise AttributeError(f"module 'mujoco' has no attribute {name!r}")
