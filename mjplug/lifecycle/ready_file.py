"""A file that exists while the server is ready, for scripts that start a server."""

import contextlib
import json
import os
import tempfile
from pathlib import Path

from mjplug.errors import MjplugError


class ReadyFile:
    """The ready file. It contains one JSON object: `endpoint`, `server` (its full name), `pid`.

    The file of an earlier server is removed at once, so that no script takes it for the file of this server.

    Args:
        path: The path of the file.

    Raises:
        MjplugError: The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            # Checked now, because later the whole start would have been useless.
            descriptor, name = _temporary(path)
            os.close(descriptor)
            Path(name).unlink()
            path.unlink(missing_ok=True)
        except OSError as error:
            raise _unwritable(path, error) from error

    def write(self, endpoint: str, server: str) -> None:
        """Writes the file in one operation, so that no reader sees a part of it.

        Raises:
            MjplugError: The file cannot be written.
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
        """Removes the file, unless another server has replaced it."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            if json.loads(self._path.read_text(encoding="utf-8"))["pid"] == os.getpid():
                self._path.unlink()


def _temporary(path: Path) -> tuple[int, str]:
    """Creates a file in the folder of `path`, from where it can be moved in one operation."""
    return tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)


def _unwritable(path: Path, error: OSError) -> MjplugError:
    return MjplugError(f"cannot write the ready file {path}: {error.strerror or error}")
