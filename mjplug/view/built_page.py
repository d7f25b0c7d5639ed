"""The files of the page, which `make page` builds from the sources in `page/`."""

import gzip
import hashlib
import mimetypes
from dataclasses import dataclass
from pathlib import Path

from mjplug.errors import MjplugError

FOLDER = Path(__file__).with_name("page")
"""Where the built page is."""

_SOURCES = Path(__file__).parents[2]
"""The folder of the sources, if mjplug runs from it."""

_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".txt": "text/plain"}
_MIN_COMPRESSED = 1024


def what_to_do(sources: Path = _SOURCES) -> str:
    """Returns a sentence for users whose mjplug has no page.

    Args:
        sources: The folder above the package, which contains the sources of the page if mjplug runs from it.
    """
    if (sources / "page" / "package.json").is_file():
        return f"the page has not been built; run `make page` in {sources}"
    return (
        "this installation of mjplug has no page, because the page had not been built before; run `make page` in the "
        "folder with the sources of mjplug, and install it from there again: pip install '.[view]'"
    )


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file of the page.

    Attributes:
        content: Its content.
        compressed: Its content, compressed with gzip; None if that is no use.
        type: Its content type.
        tag: Its entity tag.
    """

    content: bytes
    compressed: bytes | None
    type: str
    tag: str


class BuiltPage:
    """The files of the page, read again after they have changed.

    Args:
        folder: Where they are; None means `FOLDER`.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = FOLDER if folder is None else folder
        self._cached: dict[str, tuple[int, PageFile]] = {}

    @property
    def built(self) -> bool:
        """Whether there is a page."""
        return (self._folder / "index.html").is_file()

    def require(self) -> None:
        """Checks that there is a page.

        Raises:
            MjplugError: There is none; the text says how to build it.
        """
        if not self.built:
            raise MjplugError(what_to_do())

    def find(self, name: str) -> PageFile | None:
        """Returns a file by its path relative to the folder, such as `page.js`; None if there is none.

        The path is compared with those of the existing files, so it cannot lead out of the folder.
        """
        for path in self._folder.rglob("*"):
            if path.relative_to(self._folder).as_posix() == name and path.is_file():
                return self._read(name, path)
        return None

    def _read(self, name: str, path: Path) -> PageFile:
        changed = path.stat().st_mtime_ns
        cached = self._cached.get(name)
        if cached is not None and cached[0] == changed:
            return cached[1]
        content = path.read_bytes()
        kind = _TYPES.get(path.suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
        text = kind.startswith("text/")
        file = PageFile(
            content,
            gzip.compress(content, mtime=0) if text and len(content) >= _MIN_COMPRESSED else None,
            f"{kind}; charset=utf-8" if text else kind,
            f'"{hashlib.sha256(content).hexdigest()[:32]}"',
        )
        self._cached[name] = changed, file
        return file
