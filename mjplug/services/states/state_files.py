"""Saved states as files: a ZIP archive without compression, with `header.json` and arrays in NumPy's format.

`numpy.load` reads the arrays. Nothing is pickled, and nothing in a file is used as a path. May be used on any thread.
"""

import io
import os
import re
import stat
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError, quoted
from mjplug.services.states.saved_state import Header, SavedState

SUFFIX = ".npz"
MAX_HEADER = 16 << 20
"""Maximum size of `header.json` [bytes]."""
MAX_ARRAYS = 10_000
"""Maximum number of members of a file: the header and the arrays."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
_HEADER = "header.json"
_KINDS = "biuf"


def check_name(name: str) -> str:
    """Returns the name of a state if it is valid.

    Raises:
        RequestError: It is not.
    """
    if not _NAME.fullmatch(name):
        raise RequestError(
            f"{quoted(name)} cannot be the name of a state; use letters, digits and underscores, at most 64, "
            "and no digit at the beginning"
        )
    return name


class StateFiles:
    """The saved states in a folder.

    Args:
        folder: The folder; it is created with the first file.
        max_states: Maximum number of states in the folder.
        max_bytes: Maximum size of all states in the folder [bytes].
    """

    def __init__(self, folder: Path, max_states: int, max_bytes: int) -> None:
        self._folder = folder
        self._max_states = max_states
        self._max_bytes = max_bytes

    def write(self, name: str, state: SavedState, overwrite: bool) -> int:
        """Writes a state to a temporary file, waits until it is on the disk, and renames it.

        Args:
            name: The name of the state; the caller has checked it.
            state: The state.
            overwrite: Whether to replace a file of the same name.

        Returns:
            The size of the file [bytes].

        Raises:
            RequestError: The file exists or cannot be written, or the folder is full.
        """
        path = self._path(name)
        with _refusing(f"state {name!r} cannot be written to {self._folder}"):
            self._folder.mkdir(parents=True, exist_ok=True)
            present = dict(self._sizes())
            if name in present and not overwrite:
                raise RequestError(f"the file {path} already exists; set overwrite, or choose another name")
            try:
                content = encode(state)
            except RequestError as error:
                raise RequestError(f"state {name!r} cannot be written: {error}") from None
            others = sum(size for other, size in present.items() if other != name)
            if len(present.keys() | {name}) > self._max_states:
                raise RequestError(
                    f"{self._folder} contains {len(present)} states, the maximum (snapshots.max_states); delete one"
                )
            if others + len(content) > self._max_bytes:
                raise RequestError(
                    f"the states in {self._folder} would take {others + len(content)} bytes; the maximum is "
                    f"{self._max_bytes} (snapshots.max_bytes); delete one"
                )
            self._replace(path, content, overwrite)
        return len(content)

    def read(self, name: str) -> SavedState:
        """Reads a state.

        Raises:
            RequestError: There is no such file, or it is not a valid state.
        """
        with self._opened(name) as file:
            content = file.read(self._max_bytes + 1)
        try:
            return decode(content)
        except RequestError as error:
            raise RequestError(f"the file {self._path(name)} cannot be read: {error}") from None

    def list(self) -> tuple[list[tuple[str, Header, int]], list[str]]:
        """Returns name, header and size [bytes] of each state, by name, and an error for each invalid file."""
        found: list[tuple[str, Header, int]] = []
        errors: list[str] = []
        for name, size in sorted(self._sizes()):
            try:
                with self._opened(name) as file:
                    found.append((name, _header(file), size))
            except RequestError as error:
                errors.append(f"{name}: {error}")
        return found, errors

    def delete(self, name: str) -> None:
        """Deletes a state.

        Raises:
            RequestError: There is no such file, or it cannot be deleted.
        """
        with _refusing(f"the file {self._path(name)} cannot be deleted"):
            try:
                self._path(name).unlink()
            except FileNotFoundError:
                raise self._missing(name) from None

    def _path(self, name: str) -> Path:
        return self._folder / f"{check_name(name)}{SUFFIX}"

    def _missing(self, name: str) -> RequestError:
        names = ", ".join(sorted(dict(self._sizes()))[:20]) or "none"
        return RequestError(f"there is no file {name}{SUFFIX} in {self._folder}; states there: {names}")

    def _sizes(self) -> Iterator[tuple[str, int]]:
        """Yields name and size [bytes] of each state in the folder."""
        with suppress(FileNotFoundError), os.scandir(self._folder) as entries:
            for entry in entries:
                name = entry.name.removesuffix(SUFFIX)
                if name != entry.name and _NAME.fullmatch(name) and entry.is_file():
                    with suppress(FileNotFoundError):
                        yield name, entry.stat().st_size

    @contextmanager
    def _opened(self, name: str) -> Iterator[io.BufferedReader]:
        """Opens the file of a state, if it is a regular file that is not too large."""
        path = self._path(name)
        with _refusing(f"the file {path} cannot be read"):
            try:
                # A pipe would block the thread.
                descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
            except FileNotFoundError:
                raise self._missing(name) from None
            with open(descriptor, "rb") as file:
                status = os.fstat(file.fileno())
                if not stat.S_ISREG(status.st_mode):
                    raise RequestError(f"{path} is not a file")
                if status.st_size > self._max_bytes:
                    raise RequestError(
                        f"{path} has {status.st_size} bytes; the maximum is {self._max_bytes} (snapshots.max_bytes)"
                    )
                yield file

    def _replace(self, path: Path, content: bytes, overwrite: bool) -> None:
        descriptor, temporary = tempfile.mkstemp(prefix=".", suffix=".tmp", dir=self._folder)
        try:
            with open(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            if overwrite:
                os.replace(temporary, path)
            else:
                # Unlike `rename`, this does not replace a file that another server has written meanwhile.
                os.link(temporary, path)
        except FileExistsError:
            raise RequestError(f"the file {path} already exists; set overwrite, or choose another name") from None
        finally:
            with suppress(FileNotFoundError):
                os.unlink(temporary)
        _sync_folder(self._folder)


def encode(state: SavedState) -> bytes:
    """Returns a state as the content of a file.

    Raises:
        RequestError: It is too large to be read again.
    """
    header = state.header.to_json()
    if len(header) > MAX_HEADER:
        raise RequestError(
            f"its header has {len(header)} bytes; at most {MAX_HEADER} can be read (plugins save too much)"
        )
    # The header is a member of the archive too.
    if len(state.arrays) >= MAX_ARRAYS:
        raise RequestError(f"it has {len(state.arrays)} arrays; at most {MAX_ARRAYS - 1} can be read")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        # A ZipInfo has a fixed date, so that equal states give equal files.
        archive.writestr(zipfile.ZipInfo(_HEADER), header)
        for name, array in state.arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), member.getvalue())
    return buffer.getvalue()


def decode(content: bytes) -> SavedState:
    """Reads the content of a file. No more memory is used than the content takes.

    Raises:
        RequestError: It is not a valid state.
    """
    buffer = io.BytesIO(content)
    header = _header(buffer)
    arrays: dict[str, NDArray[Any]] = {}
    with _valid_archive(), zipfile.ZipFile(buffer) as archive:
        for info in _members(archive, len(content)):
            if info.filename != _HEADER:
                name = info.filename.removesuffix(".npy")
                arrays[name] = _array(archive.read(info), info.filename)
    return SavedState(header, arrays)


def _header(file: Any) -> Header:
    with _valid_archive(), zipfile.ZipFile(file) as archive:
        size = file.seek(0, os.SEEK_END)
        found = [info for info in _members(archive, size) if info.filename == _HEADER]
        if len(found) != 1 or found[0].file_size > MAX_HEADER:
            raise RequestError(f"it contains no {_HEADER}, or a too large one")
        text = archive.read(found[0])
    return Header.from_json(text)


def _members(archive: zipfile.ZipFile, size: int) -> list[zipfile.ZipInfo]:
    """Returns the members of an archive, whose names are unique and which are stored without compression."""
    members = archive.infolist()
    names = {info.filename for info in members}
    plain = all(info.compress_type == zipfile.ZIP_STORED and not info.flag_bits & 1 for info in members)
    # Members might overlap.
    fitting = sum(info.file_size for info in members) <= size
    if len(members) > MAX_ARRAYS or len(names) != len(members) or not plain or not fitting:
        raise RequestError("its members are invalid")
    return members


def _array(content: bytes, name: str) -> NDArray[Any]:
    """Reads an array in NumPy's format, without trusting the size in it."""
    file = io.BytesIO(content)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise RequestError(f"{quoted(name)} has version {version}")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    body = memoryview(content)[file.tell() :]
    count = 1
    for length in shape:
        count *= int(length)
    if fortran or dtype.hasobject or dtype.kind not in _KINDS or any(length < 0 for length in shape):
        raise RequestError(f"{quoted(name)} is an array of {dtype}, which is not allowed")
    if count * dtype.itemsize != len(body):
        raise RequestError(f"{quoted(name)} has another size than it says")
    return np.frombuffer(body, dtype).reshape(shape).copy()


@contextmanager
def _valid_archive() -> Iterator[None]:
    try:
        yield
    except RequestError:
        raise
    except Exception as error:
        # `zipfile` and NumPy raise many kinds of exceptions for content that is not theirs.
        raise RequestError(f"it is not a saved state: {type(error).__name__}: {error}") from None


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RequestError(f"{what}: {error.strerror or error}") from None


def _sync_folder(folder: Path) -> None:
    """Waits until the new name is on the disk, where the platform supports it."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
