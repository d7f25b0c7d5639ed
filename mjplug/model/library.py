"""Models that clients may load: files below configured folders, bundled models, and XML texts without files."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.parsers import expat

from mjplug.errors import ModelError
from mjplug.model.location import BUNDLED, PACKAGE, bundled_models, locate
from mjplug.model.recipe import CompositionError, Source

SUFFIXES = (".xml", ".urdf")
"""Suffixes of models that can be added to another model."""

MAX_TEXT_BYTES = 1 << 20
"""Maximum length of a model as text [bytes]."""

MAX_ELEMENTS = 20_000
"""Maximum number of XML elements in a model as text, with those that `replicate` and similar elements make."""

MAX_SIZE = 4096
"""Maximum of a number of pixels, rows or columns in a model as text."""

_FILES = frozenset({"file", "filename", "fileleft", "fileright", "fileup", "filedown", "filefront", "fileback"})
_FOLDERS = frozenset({"meshdir", "texturedir", "assetdir"})
_REFUSED = frozenset({"include", "extension", "plugin", "size", "model"})
_COUNTED = frozenset({"width", "height", "nrow", "ncol", "maxhullvert", "maxcontacts"})
_REPEATS = frozenset({"replicate", "composite", "flexcomp"})


class Library:
    """The models below some folders.

    Args:
        folders: The folders.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = tuple(folders)

    def find(self, uri: str) -> Source:
        """Returns the model at an address: `file:///…`, a path relative to a folder, `package://…` or `bundled:NAME`.

        Raises:
            CompositionError: It is outside the folders, does not exist or has another format.
        """
        if uri.startswith(BUNDLED):
            try:
                return Source(locate(uri))
            except ModelError as error:
                raise CompositionError("resource", str(error)) from error
        refused = CompositionError(
            "resource", f"{uri[:200]!r} is not a model below the folders that are configured for it"
        )
        if "\0" in uri or not self._folders:
            raise refused
        for candidate in self._candidates(uri):
            path = Path(os.path.realpath(candidate))
            if any(path.is_relative_to(os.path.realpath(folder)) for folder in self._folders) and path.is_file():
                if path.suffix.lower() not in SUFFIXES:
                    raise CompositionError("format", f"{path.name} is not one of {', '.join(SUFFIXES)}")
                return Source(path)
        raise refused

    def files(self) -> Iterator[Path]:
        """Yields all models below the folders."""
        for folder in self._folders:
            for path in sorted(folder.rglob("*")):
                if path.suffix.lower() in SUFFIXES and path.is_file():
                    yield path

    def _candidates(self, uri: str) -> list[Path]:
        if uri.startswith(PACKAGE):
            try:
                return [locate(uri)]
            except ModelError:
                return []
        if uri.startswith("file:"):
            parts = urlsplit(uri)
            return [Path(unquote(parts.path))] if parts.netloc in ("", "localhost") else []
        return [folder / uri for folder in self._folders]


def bundled() -> list[str]:
    """Returns the addresses of the models that are included in mjplug."""
    return [f"{BUNDLED}{name}" for name in bundled_models()]


def text_source(text: str) -> Source:
    """Checks a model that a client has sent as XML text.

    It must not read files, and its size is limited, because any client can send it.

    Raises:
        CompositionError: It is refused.
    """
    size = len(text.encode())
    if size > MAX_TEXT_BYTES:
        raise CompositionError("parse", f"the model has {size} bytes; at most {MAX_TEXT_BYTES} are accepted")
    _Check(text)
    return Source(None, text)


class _Check:
    """Reads an XML text and refuses what costs too much or reads files."""

    def __init__(self, text: str) -> None:
        self._total = 0
        self._factors = [1]
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._begin
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            raise CompositionError("parse", f"the model is not XML: {error}") from None

    def _doctype(self, *_: object) -> None:
        raise CompositionError("parse", "the model has a DOCTYPE, which is not accepted")

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        if tag in _REFUSED:
            raise CompositionError("unsupported", f"the model contains <{tag}>, which is not accepted in a text")
        named = _FILES | _FOLDERS
        if found := sorted(named & attributes.keys()):
            raise CompositionError(
                "unsupported", f"the model uses a file ({found[0]} of <{tag}>); send it by its address"
            )
        for name in _COUNTED & attributes.keys():
            if _largest(attributes[name]) > MAX_SIZE:
                raise CompositionError("unsupported", f"{name} of <{tag}> is larger than {MAX_SIZE}")
        factor = self._factors[-1]
        if tag in _REPEATS:
            product = 1
            for number in attributes.get("count", "1").split():
                product *= max(1, _largest(number))
            factor *= min(product, MAX_ELEMENTS + 1)
            self._total += factor
        self._factors.append(factor)
        self._total += factor
        if self._total > MAX_ELEMENTS:
            raise CompositionError("unsupported", f"the model has more than {MAX_ELEMENTS} elements")

    def _end(self, tag: str) -> None:
        self._factors.pop()


def _largest(text: str) -> int:
    numbers = [0]
    for word in text.split():
        try:
            numbers.append(int(float(word)))
        except (ValueError, OverflowError):
            continue
    return max(numbers)
