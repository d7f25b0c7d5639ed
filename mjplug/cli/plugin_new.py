"""`mjplug plugin new`: a package with a plugin that installs, passes its own test and shows up in the list."""

import keyword
import re
from importlib.resources import files
from pathlib import Path
from string import Template

from mjplug.cli.new_files import write_folder
from mjplug.errors import MjplugError

_FILES = {
    "pyproject.toml.txt": "pyproject.toml",
    "README.md.txt": "README.md",
    "plugin.py.txt": "src/{name}/plugin.py",
    "test_plugin.py.txt": "tests/test_{name}.py",
}
"""The templates, and where they go."""


def write(name: str, into: Path) -> Path:
    """Writes the package.

    Args:
        name: The plugin's name, which becomes that of the package, the module and the entry point.
        into: Where its folder goes.

    Returns:
        The folder.

    Raises:
        MjplugError: The name cannot be that of a module, is taken, or the folder is there or cannot be written.
    """
    _check(name)
    folder = into / name
    class_name = "".join(part.capitalize() for part in name.split("_"))
    templates = files("mjplug.cli") / "plugin_template"
    written = {
        target.format(name=name): Template((templates / source).read_text(encoding="utf-8")).substitute(
            name=name, class_name=class_name
        )
        for source, target in _FILES.items()
    }
    written[f"src/{name}/__init__.py"] = f'"""A plugin for mjplug: {name}."""\n'
    write_folder(folder, written)
    return folder


def _check(name: str) -> None:
    from importlib.metadata import entry_points
    from importlib.util import find_spec

    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        better = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        hint = f"; try {better}" if re.fullmatch(r"[a-z][a-z0-9_]*", better) and not keyword.iskeyword(better) else ""
        raise MjplugError(f"{name!r} cannot be the name of a module: small letters, digits and _ are allowed{hint}")
    if name in {point.name for point in entry_points(group="mjplug.plugins")}:
        raise MjplugError(f"there is a plugin {name!r} already; choose another name")
    if find_spec(name) is not None:
        raise MjplugError(f"there is a module {name!r} already, which the plugin would hide; choose another name")
