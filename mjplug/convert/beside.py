"""Folders that are written beside their place and moved there at the end, so that nothing half-written is seen."""

import contextlib
import ctypes
import os
import re
import shutil
import socket
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextlib.contextmanager
def written_beside(folder: Path, files: Mapping[str, bytes]) -> Iterator[Path]:
    """Writes files into a new folder beside `folder`, which is removed at the end unless it was moved away.

    Folders of processes on this machine that were killed in between are removed first.

    Args:
        folder: The place for which they are written.
        files: Contents by path.

    Raises:
        OSError: They cannot be written.
    """
    parent = folder.absolute().parent
    parent.mkdir(parents=True, exist_ok=True)
    start = f".{folder.name}.{_machine()}."
    for name in os.listdir(parent):
        left = re.fullmatch(re.escape(start) + r"(\d+)\..*", name)
        if left and not _is_running(int(left[1])):
            shutil.rmtree(parent / name, ignore_errors=True)
    beside = Path(tempfile.mkdtemp(prefix=f"{start}{os.getpid()}.", dir=parent))
    try:
        for name, content in files.items():
            path = beside / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        yield beside
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def exchange(first: Path, second: Path) -> bool:
    """Exchanges two folders in one step.

    Returns:
        Whether the operating system and the file system can do this; otherwise nothing has changed.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename = ctypes.CDLL(None).renameat2
    except (AttributeError, OSError):
        return False
    result: int = rename(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), _RENAME_EXCHANGE)
    return result == 0


def _machine() -> str:
    return re.sub(r"[^\w-]", "_", socket.gethostname())


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
