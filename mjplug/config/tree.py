"""Merges the values of files and options to one configuration: values by path, each with its place."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import cast

from mjplug.config.document import Document, KeyPath, Place
from mjplug.config.problem import Mark, Source


class NotASectionError(Exception):
    """A part of a path is a value that cannot contain the next part.

    Attributes:
        path: The path of this value.
        value: The value.
    """

    def __init__(self, path: KeyPath, value: object) -> None:
        super().__init__(path, value)
        self.path = path
        self.value = value


class Tree:
    """Nested mappings with the place of each value.

    Attributes:
        value: The values.

    Args:
        source: The source for messages about missing values, such as the main file.
    """

    def __init__(self, source: Source) -> None:
        self.value: dict[str, object] = {}
        self._places: dict[KeyPath, Place] = {(): Place(Mark(source), Mark(source))}

    def merge(self, document: Document) -> None:
        """Adds a document, whose root must be a mapping. Mappings are merged; other values replace existing ones."""
        self._merge((), self.value, cast(Mapping[str, object], document.value))
        self._places |= {path: place for path, place in document.places.items() if path}

    def _merge(self, path: KeyPath, into: dict[str, object], new: Mapping[str, object]) -> None:
        for key, value in new.items():
            here = (*path, key)
            old = into.get(key)
            if isinstance(old, dict) and isinstance(value, dict):
                self._merge(here, old, value)
            else:
                if key in into:
                    self._forget(here)
                into[key] = deepcopy(value)

    def put(self, path: Sequence[str], value: object, place: Place) -> None:
        """Sets a value, and creates missing sections of its path.

        Args:
            path: The path of the value; an item of a list is given by its index as text.
            value: The value; a mapping replaces an existing one.
            place: The place of the value and of all its parts.

        Raises:
            NotASectionError: A part of the path is neither a mapping nor a list with this index.
        """
        node: object = self.value
        done: KeyPath = ()
        for part in path[:-1]:
            key = _key(node, part, done)
            children = cast(dict[str | int, object], node)
            done = (*done, key)
            if isinstance(node, dict) and children.get(key) is None:
                children[key] = {}
                self._places[done] = place
            node = children[key]
        key = _key(node, path[-1], done)
        done = (*done, key)
        self._forget(done)
        cast(dict[str | int, object], node)[key] = deepcopy(value)
        self._places[done] = place

    def get(self, path: KeyPath) -> object:
        """Returns the value at a path; None if there is none."""
        node: object = self.value
        for part in path:
            in_mapping = isinstance(node, dict) and part in node
            in_list = isinstance(node, list) and isinstance(part, int) and part < len(node)
            if not (in_mapping or in_list):
                return None
            node = cast(dict[str | int, object], node)[part]
        return node

    def remove(self, key: str) -> None:
        """Removes a key of the root."""
        del self.value[key]
        self._forget((key,))

    def place(self, path: KeyPath) -> Place:
        """Returns the place of the value at a path; if there is no such value, the place of its nearest section."""
        while path not in self._places:
            path = path[:-1]
        return self._places[path]

    def _forget(self, path: KeyPath) -> None:
        for known in [p for p in self._places if p[: len(path)] == path]:
            del self._places[known]


def _key(node: object, part: str, path: KeyPath) -> str | int:
    if isinstance(node, dict):
        return part
    if isinstance(node, list) and part.isdecimal() and int(part) < len(node):
        return int(part)
    raise NotASectionError(path, node)
