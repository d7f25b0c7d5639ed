"""Libraries with plugins of the MuJoCo engine: actuators, sensors, passive forces and so on, written in C or C++.

MuJoCo registers what they contain for the whole process and never unloads it.
"""

from pathlib import Path

import mujoco

from mjplug.errors import ModelError

_loaded: dict[Path, None] = {}


def load(path: Path) -> None:
    """Loads a library, if this process has not loaded it before. The library runs native code: trust it.

    Raises:
        ModelError: It cannot be loaded.
    """
    path = path.resolve()
    if path in _loaded:
        return
    try:
        mujoco.mj_loadPluginLibrary(str(path))
    except mujoco.FatalError as error:
        # "Error loading plugin library '<path>': <path>: <reason of the system>"
        reason = " ".join(str(error).split()).rpartition(f"{path}: ")[2]
        raise ModelError(f"{path} cannot be loaded as a plugin library of MuJoCo: {reason}") from error
    _loaded[path] = None


def loaded() -> tuple[str, ...]:
    """Returns the libraries that this process has loaded, in their order; worker processes load the same."""
    return tuple(map(str, _loaded))
