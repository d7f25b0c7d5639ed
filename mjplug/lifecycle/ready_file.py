"""A file that is there while the server is ready, for scripts that start one."""

import contextlib
import json
import os
import tempfile
from pathlib import Path

from mjplug.errors import MjplugError


class ReadyFile:
    """The file, which holds one JSON object: `endpoint`, `server` (its full name), `pid`.

    A file that an earlier server left behind is removed at once, so that nobody takes it for this server's.

    Args:
        path: Where it is written.

    Raises:
        MjplugError: It cannot be written there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            # Tried now, since a server that finds out when it is ready has started in vain.
            descriptor, name = _temporary(path)
            os.close(descriptor)
            Path(name).unlink()
            path.unlink(missing_ok=True)
        except OSError as error:
            raise _unwritable(path, error) from error

    def write(self, endpoint: str, server: str) -> None:
        """Writes the file; a reader never sees a part of it.

        Raises:
            MjplugError: It cannot be written.
        """
        text = json.dumps({"endpoint": endpoint, "server": server, "pid": os.getpid()})
        try:
            descriptor, name = _temporary(self._path)
            with os.fdopen(descriptor, "w", encoding="utf-8") as file:
                file.write(f"{text}\n")
            Path(name).replace(self._path)
        except OSError as error:
            raise _unwritable(self._path, error) from error

    def remove(self) -> None:
        """Removes it, unless another server has written it meanwhile."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            if json.loads(self._path.read_text(encoding="utf-8"))["pid"] == os.getpid():
                self._path.unlink()


def _temporary(path: Path) -> tuple[int, str]:
    """Makes a file beside `path`, from where it can be moved in one operation."""
    return tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)


def _unwritable(path: Path, error: OSError) -> MjplugError:
    return MjplugError(f"cannot write the ready file {path}: {error.strerror or error}")
