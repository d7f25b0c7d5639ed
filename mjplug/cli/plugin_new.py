"""`mjplug plugin new`: creates a package with a plugin that installs and passes its own test."""

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
"""The path in the package, by name of the template."""


def write(name: str, into: Path) -> Path:
    """Writes the package.

    Args:
        name: The name of the plugin, the package, the module and the entry point.
        into: The parent folder.

    Returns:
        The new folder.

    Raises:
        MjplugError: The name is not a module name or is taken, or the folder exists or cannot be written.
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
        raise MjplugError(
            f"{name!r} cannot be the name of a module: lower-case letters, digits and _ are allowed{hint}"
        )
    if name in {point.name for point in entry_points(group="mjplug.plugins")}:
        raise MjplugError(f"a plugin {name!r} already exists; choose another name")
    if find_spec(name) is not None:
        raise MjplugError(f"a module {name!r} already exists, and the plugin would hide it; choose another name")
