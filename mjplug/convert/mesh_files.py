"""Finds the files of meshes and textures: `package://`, `file://`, `model://`, relative and absolute paths."""

from pathlib import Path
from urllib.parse import unquote

from mjplug.convert.confined import check_file
from mjplug.errors import ModelError
from mjplug.model.location import PACKAGE, file_in_package
from mjplug.model.packages import Packages

_MODEL = "model://"
_FILE = "file://"


class MeshFiles:
    """Finds files that a URDF names.

    Args:
        folder: The folder of the URDF.
        packages: ROS packages.
        confined: Whether only files in ROS packages are found.
    """

    def __init__(self, folder: Path, packages: Packages, confined: bool = False) -> None:
        self._folder, self._packages, self._confined = folder, packages, confined

    def find(self, uri: str) -> Path:
        """Returns the file of a URI.

        Raises:
            ModelError: There is no such file.
        """
        for scheme in (PACKAGE, _MODEL):
            if uri.startswith(scheme):
                try:
                    found = file_in_package(PACKAGE + uri.removeprefix(scheme), self._packages)
                    return check_file(str(found.absolute()), self._packages) if self._confined else found
                except ModelError as error:
                    if self._confined:
                        raise
                    beside = self._folder / Path(uri).name
                    if beside.is_file():
                        return beside
                    raise ModelError(self._reason(uri, str(error))) from None
        if self._confined:
            check_file(uri, self._packages)
        text = unquote(uri.removeprefix(_FILE)) if uri.startswith(_FILE) else uri
        file = Path(text) if Path(text).is_absolute() else self._folder / text
        if file.is_file():
            return file
        raise ModelError(f"there is no file {file}")

    def _reason(self, uri: str, reason: str) -> str:
        name = uri.partition("://")[2].lstrip("/").partition("/")[0]
        folders = ", ".join(map(str, dict.fromkeys(self._packages.folders(name))))
        return f"{uri}: there is no such file in {folders}" if folders else reason

    def portable(self, uri: str) -> str | None:
        """Returns the URI as `package://` if it contains an absolute path; None if the file is in no package."""
        if uri.startswith((PACKAGE, _MODEL)):
            return uri
        text = unquote(uri.removeprefix(_FILE))
        if not Path(text).is_absolute():
            return uri
        owner = self._packages.of(Path(text))
        return None if owner is None else f"{PACKAGE}{owner[0]}/{owner[1]}"
