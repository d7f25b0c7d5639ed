"""Imports MuJoCo, in a way that a camera setting cannot break."""

import os


def import_mujoco() -> None:
    """Imports MuJoCo without a GL backend, which this process does not need.

    With MUJOCO_GL=egl or osmesa, and without their libraries, the import itself would fail.
    """
    backend = os.environ.pop("MUJOCO_GL", None)
    try:
        import mujoco  # noqa: F401
    finally:
        if backend is not None:
            os.environ["MUJOCO_GL"] = backend
