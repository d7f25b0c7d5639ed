"""Plugin modules in the folder of a configuration file: `type: wind:Wind` with the file `wind.py` in that folder.

The folder stays on `sys.path` until the server ends, because plugins may import more modules later, and worker
processes import from it too. Module names are unique in a process, so two servers in one process cannot use two
different modules `wind`.
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
    """Makes modules of a folder importable until the end of the block.

    When the last such block ends, the folder is removed from `sys.path`, and the plugin modules that were imported from
    it are removed from `sys.modules`, so that the next server imports them again with all changes. Nothing is removed
    if the folder was on `sys.path` before.
    """
    with _lock:
        change = _folders.setdefault(str(folder), _Folder(str(folder)))
    with change.held():
        yield


def import_plugin_module(name: str, folder: Path | None = None) -> ModuleType:
    """Imports a module and returns it.

    Args:
        name: The dotted name of the module.
        folder: The folder of the configuration file, which must be `importable`; None if there is none.

    Raises:
        PluginError: A different module with the same name was imported for another server, for this module or for one
            that it imports.
    """
    with _lock:
        others = [other for path, other in _folders.items() if folder is None or path != str(folder)]
        _move_behind(folder, others)
        _refuse_another_file(name.partition(".")[0], folder, others)
    before = set(sys.modules)
    module = importlib.import_module(name)
    new = {found: sys.modules[found] for found in set(sys.modules) - before if found in sys.modules}
    with _lock:
        for known in _folders.values():
            known.note(new)
    return module


_lock = threading.Lock()


class _Folder(SharedChange):
    """A folder on `sys.path`.

    Attributes:
        path: The folder.
        added: Whether a server added it to `sys.path`.
        modules: Names of its modules that were imported for plugins.
    """

    def __init__(self, path: str) -> None:
        super().__init__(self._add)
        self.path = path
        self.modules: set[str] = set()
        self.added = False

    def note(self, modules: dict[str, ModuleType]) -> None:
        """Records which of some newly imported modules are in the folder."""
        if self.added:
            self.modules |= {name for name, module in modules.items() if _is_in(_file(module), Path(self.path))}

    def _add(self) -> Undo:
        if self.path in sys.path:
            return _nothing
        sys.path.append(self.path)
        # A file may have been written since the folder was last listed.
        importlib.invalidate_caches()
        self.added = True
        return self._remove

    def _remove(self) -> None:
        self.added = False
        # Other code may have removed it.
        if self.path in sys.path:
            sys.path.remove(self.path)
        for name in self.modules:
            sys.modules.pop(name, None)
        self.modules.clear()


_folders: dict[str, _Folder] = {}


def _move_behind(folder: Path | None, others: list[_Folder]) -> None:
    """Moves the folders of other servers to the end of `sys.path`."""
    theirs = [other.path for other in others if other.added]
    if folder is not None and str(folder) in sys.path:
        sys.path[:] = [path for path in sys.path if path not in theirs] + theirs


def _refuse_another_file(top: str, folder: Path | None, others: list[_Folder]) -> None:
    theirs = {other.path for other in others if other.added}
    path = [entry for entry in sys.path if entry not in theirs]
    names = [top]
    if folder is not None and _is_in(_origin(top, path), folder):
        # The module may import a module with the same name as one that plugins of another server have imported.
        names += [name for other in others for name in sorted(other.modules) if "." not in name]
    for name in names:
        file, origin = _file(sys.modules.get(name)), _origin(name, path)
        if name == "__main__" or file is None or origin is None or Path(origin).resolve() == Path(file).resolve():
            continue
        raise PluginError(
            f"module {name!r} is already imported from {file}, so {origin} cannot be imported in the same process; "
            "rename one of the two files, or run the two servers in two processes"
        )


def _origin(name: str, path: list[str]) -> str | None:
    """Returns the file that an import would read; None for built-in modules, namespace packages and the like."""
    spec = importlib.machinery.PathFinder.find_spec(name, path)
    return spec.origin if spec is not None and spec.has_location else None


def _is_in(file: str | None, folder: Path) -> bool:
    return file is not None and Path(file).is_relative_to(folder)


def _file(module: ModuleType | None) -> str | None:
    return getattr(module, "__file__", None)


def _nothing() -> None:
    pass
