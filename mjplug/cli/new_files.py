"""Files that a command makes: whole, or not at all."""

import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from mjplug.errors import MjplugError


def write_file(path: Path, text: str) -> None:
    """Writes a file that does not exist yet.

    Raises:
        MjplugError: It exists, or cannot be written; then no part of it is left.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            try:
                file.write(text)
                # Here, and not when the file is closed: a full disk may be noticed only now.
                file.flush()
            except OSError:
                path.unlink(missing_ok=True)
                raise
    except FileExistsError:
        raise MjplugError(f"{path} is there already; remove it, or choose another name") from None
    except OSError as error:
        raise MjplugError(f"cannot write {path}: {error.strerror or error}") from error


def write_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Writes a folder that does not exist yet, with files in it.

    Args:
        folder: The folder; those above it are made too.
        files: Texts by relative paths.

    Raises:
        MjplugError: It exists, or cannot be written; then nothing of it is left, nor of the folders above that it
            needed.
    """
    missing = [above for above in (folder, *folder.parents) if not above.exists()]
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise MjplugError(f"{folder} is there already; choose another name, or another folder with --into") from None
    except OSError as error:
        _remove(missing)
        raise MjplugError(f"cannot make {folder}: {error.strerror or error}") from error
    try:
        for path, text in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            write_file(folder / path, text)
    except OSError as error:
        _remove(missing)
        raise MjplugError(f"cannot write {error.filename or folder}: {error.strerror or error}") from error
    except MjplugError:
        _remove(missing)
        raise


def _remove(folders: list[Path]) -> None:
    """Removes folders that were made here, the innermost first; one that cannot be removed stays."""
    with suppress(OSError):
        if folders[0].exists():
            shutil.rmtree(folders[0])
        for above in folders[1:]:
            if above.exists():
                above.rmdir()
