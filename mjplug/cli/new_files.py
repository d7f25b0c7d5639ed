"""Files that commands create, completely or not at all."""

import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from mjplug.errors import MjplugError


def write_file(path: Path, text: str) -> None:
    """Writes a file that does not exist yet.

    Raises:
        MjplugError: It exists, or cannot be written; no incomplete file remains.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            try:
                file.write(text)
                # A full disk may be noticed only here; an error in `close` would be too late.
                file.flush()
            except OSError:
                path.unlink(missing_ok=True)
                raise
    except FileExistsError:
        raise MjplugError(f"{path} already exists; remove it, or choose another name") from None
    except OSError as error:
        raise MjplugError(f"cannot write {path}: {error.strerror or error}") from error


def write_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Writes a folder that does not exist yet, with files in it.

    Args:
        folder: The folder; missing parent folders are created.
        files: Texts by relative paths.

    Raises:
        MjplugError: It exists, or cannot be written; neither it nor the parent folders that were created remain.
    """
    missing = [above for above in (folder, *folder.parents) if not above.exists()]
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise MjplugError(f"{folder} already exists; choose another name, or another folder with --into") from None
    except OSError as error:
        _remove(missing)
        raise MjplugError(f"cannot create {folder}: {error.strerror or error}") from error
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
    """Removes the folders that `write_folder` has created, the innermost first; ignores errors."""
    with suppress(OSError):
        if folders[0].exists():
            shutil.rmtree(folders[0])
        for above in folders[1:]:
            if above.exists():
                above.rmdir()
