"""Plugin modules that lie in the folder of a configuration file: `type: wind:Wind`, with a `wind.py` beside it.

The folder is on `sys.path` as long as a server needs it, because plugins may import more later, and worker processes
import from there too. A process has one module of each name, so two servers in it cannot have two modules `wind`.
"""

import importlib
import importlib.machinery
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from mjplug.errors import PluginError
from mjplug.shared_change import SharedChange, Undo


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Lets modules of a folder be imported until the end of the block.

    When the last such block ends, the folder is removed from `sys.path`, and the plugin modules that were imported from
    it are removed from `sys.modules`: the next server imports them again, with the changes that were made meanwhile.
    Nothing is removed if the folder was on `sys.path` before.
    """
    with _lock:
        change = _folders.setdefault(str(folder), _Folder(str(folder)))
    with change.held():
        yield


def import_plugin_module(name: str) -> ModuleType:
    """Imports a module by its dotted name.

    Raises:
        PluginError: A module of this name was imported before, from a file other than the one that would be imported
            now.
    """
    top = name.partition(".")[0]
    known = sys.modules.get(top)
    if known is not None and (wrong := _another_file(top, known)):
        raise PluginError(
            f"module {top!r} of this process is {wrong[0]} already, so {wrong[1]} cannot be imported; rename one of "
            "the two files, or run the two servers in two processes"
        )
    before = set(sys.modules)
    module = importlib.import_module(name)
    new = {found: sys.modules[found] for found in set(sys.modules) - before if found in sys.modules}
    with _lock:
        for folder in _folders.values():
            folder.note(new)
    return module


_lock = threading.Lock()


class _Folder(SharedChange):
    """A folder on `sys.path`, and the modules that plugins were imported from."""

    def __init__(self, path: str) -> None:
        super().__init__(self._add)
        self._path = path
        self._modules: set[str] = set()
        self._added = False

    def note(self, modules: dict[str, ModuleType]) -> None:
        """Notes those of some newly imported modules that lie in the folder."""
        if self._added:
            inside = f"{self._path.rstrip('/')}/"
            self._modules |= {name for name, module in modules.items() if (_file(module) or "").startswith(inside)}

    def _add(self) -> Undo:
        if self._path in sys.path:
            return _nothing
        sys.path.append(self._path)
        # A file may have been written a moment ago.
        importlib.invalidate_caches()
        self._added = True
        return self._remove

    def _remove(self) -> None:
        self._added = False
        # Somebody else may have taken it out.
        if self._path in sys.path:
            sys.path.remove(self._path)
        for name in self._modules:
            sys.modules.pop(name, None)
        self._modules.clear()


_folders: dict[str, _Folder] = {}


def _another_file(name: str, known: ModuleType) -> tuple[str, str] | None:
    """Returns where a module came from and where an import would take it from now, if these are two files."""
    if name == "__main__":
        return None
    spec = importlib.machinery.PathFinder.find_spec(name)
    file = _file(known)
    # Built-in modules, namespace packages, and those that other finders provide have no file to compare.
    if file is None or spec is None or spec.origin is None or not spec.has_location:
        return None
    return None if Path(spec.origin).resolve() == Path(file).resolve() else (file, spec.origin)


def _file(module: ModuleType) -> str | None:
    return getattr(module, "__file__", None)


def _nothing() -> None:
    pass
