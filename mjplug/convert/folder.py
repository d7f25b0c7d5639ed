"""Writes a converted robot into a folder, completely or not at all."""

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from mjplug.convert.beside import exchange, written_beside
from mjplug.convert.record import digest
from mjplug.convert.report import RECORD
from mjplug.errors import ModelError


def write_folder(folder: Path, files: Mapping[str, bytes], force: bool) -> None:
    """Writes the files of a conversion.

    The files are written beside the folder and moved into place at the end, so a conversion that is killed leaves the
    folder as it was.

    Args:
        folder: The folder.
        files: Contents by path in the folder.
        force: Whether the result of an earlier conversion is replaced.

    Raises:
        ModelError: The folder exists and `force` is not set, it contains files that were edited or that no conversion
            has written, or it cannot be written.
    """
    # A link stays, and the folder that it names is replaced.
    folder = folder.resolve()
    if folder.exists():
        check_replaceable(folder, force)
    try:
        with written_beside(folder, files) as beside:
            beside.chmod(0o777 & ~_umask())
            _swap(beside, folder)
    except OSError as error:
        raise ModelError(f"{folder} cannot be written: {error.strerror or error}") from error


def check_replaceable(folder: Path, force: bool) -> None:
    """Checks that a folder may be replaced: `force` is set, and nobody has changed a file in it.

    Raises:
        ModelError: It may not.
    """
    if not folder.is_dir():
        raise ModelError(f"{folder} exists and is not a folder")
    if folder.resolve() in (Path.cwd(), *Path.cwd().parents):
        # A shell in it would be left in the folder that is removed.
        raise ModelError(f"{folder} is the current folder or contains it, so it cannot be replaced; choose another one")
    if not any(folder.iterdir()):
        return
    if not force:
        raise ModelError(f"{folder} already exists; choose another folder, or replace it with --force")
    known = _recorded(folder)
    inside = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    foreign = sorted(name for name in inside if name not in known and name != RECORD)
    edited = sorted(
        name for name, value in known.items() if name in inside and digest(inside[name].read_bytes()) != value
    )
    for what, names in (("edited since its conversion", edited), ("not written by a conversion", foreign)):
        if names:
            raise ModelError(
                f"{folder} contains files that were {what}: {', '.join(names[:5])}; move them away, or "
                "choose another folder"
            )


def _recorded(folder: Path) -> dict[str, str]:
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return {str(name): str(value) for name, value in found.items()} if isinstance(found, dict) else {}


def _swap(new: Path, folder: Path) -> None:
    """Moves a folder to a place where another one may be, which is then removed."""
    if not folder.exists():
        os.rename(new, folder)
        return
    if exchange(new, folder):
        # The old folder is now in the place of the new one, where it is removed.
        return
    old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.old.", dir=folder.absolute().parent))
    try:
        os.rename(folder, old / "folder")
        try:
            os.rename(new, folder)
        except OSError:
            os.rename(old / "folder", folder)
            raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
