"""Reads a YAML file to plain values and the place of each value.

PyYAML's C parser builds the nodes. The values are built here by ROS's scalar rules, because PyYAML's own rules read
`1e3` as text and `1:30` as 90, and accept duplicate keys without an error.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from mjplug.config.nodes import MAX_DEPTH, compose
from mjplug.config.problem import ConfigError, Mark, Problem, Source
from mjplug.config.scalar import ros_scalar

KeyPath = tuple[str | int, ...]
"""The path of a value in the configuration: `("plugins", "hb", "update_rate")`."""

MAX_BYTES = 4 << 20
"""Maximum size of a configuration file [bytes]; larger files are model or data files given by mistake."""

MAX_VALUES = 100_000
"""Maximum number of values in one file. A value counts once for each use of an alias, which stops alias bombs."""

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_STRING_TAG = "tag:yaml.org,2002:str"


@dataclass(frozen=True, slots=True)
class Place:
    """The place of one value.

    Attributes:
        key: Position of its key; for an item of a list, position of the item.
        value: Position of the value.
        plain: Text of an unquoted scalar, otherwise None.
    """

    key: Mark
    value: Mark
    plain: str | None = None


@dataclass(slots=True)
class Document:
    """One YAML document.

    Attributes:
        source: The source of the document.
        value: The content as dict, list, str, int, float, bool and None.
        places: The place of every value, by path; the root is `()`.
        problems: Problems of parts, which `value` does not contain.
    """

    source: Source
    value: object = None
    places: dict[KeyPath, Place] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


def read_document(path: Path) -> Document:
    """Reads a YAML file.

    Raises:
        ConfigError: The file cannot be read, is not a text file, or is not YAML.
    """
    text = _read_text(path)
    return parse_document(text, Source(str(path), split_lines(text), path.absolute().parent))


def parse_document(text: str, source: Source) -> Document:
    """Reads YAML text.

    Raises:
        ConfigError: The text has a syntax error, too many levels, or too many values.
    """
    document = Document(source)
    node = compose(text, source)
    if node is not None:
        document.value = _Walk(document).value(node, ())
    return document


def split_lines(text: str) -> tuple[str, ...]:
    """Splits text at YAML's line breaks; `str.splitlines` would split at other characters too."""
    return tuple(re.split("\r\n|[\n\r\x85\u2028\u2029]", text))


def unquoted(text: str) -> object:
    """Returns the value of an unquoted scalar by ROS's rules; None for empty text, `~` and `null`."""
    return None if text in _NULL else ros_scalar(text)


def _read_text(path: Path) -> str:
    source = Source(str(path))
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise _refusal(source, "no such file") from None
    except IsADirectoryError:
        raise _refusal(source, "is a directory, not a configuration file") from None
    except (OSError, ValueError) as error:
        raise _refusal(source, f"cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if len(data) > MAX_BYTES:
        raise _refusal(source, f"is larger than {MAX_BYTES >> 20} MiB, the maximum size of a configuration file")
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise _refusal(source, f"is not a text file in UTF-8 (byte {error.start})") from error
    if "\0" in text:
        raise _refusal(source, "is a binary file, not YAML text")
    if text.lstrip().startswith("<"):
        raise _refusal(source, "is XML, not YAML; the name of a model file must end with .xml or .urdf")
    return text


def _refusal(source: Source, message: str) -> ConfigError:
    return ConfigError([Problem(message, Mark(source))])


class _Walk:
    """Converts the nodes of one document to values and records their places."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._source = document.source
        self._places = document.places
        self._visited = 0

    def value(self, node: Node, path: KeyPath, key: Node | None = None) -> object:
        self._enter(node, len(path))
        mark = self._mark(node)
        plain = node.value if isinstance(node, ScalarNode) and _is_plain(node) else None
        self._places[path] = Place(self._mark(key) if key else mark, mark, plain)
        self._check_tag(node)
        if isinstance(node, MappingNode):
            return self._mapping(node, path)
        if isinstance(node, SequenceNode):
            return [self.value(item, (*path, i)) for i, item in enumerate(node.value)]
        return _scalar(node) if isinstance(node, ScalarNode) else None

    def _mapping(self, node: MappingNode, path: KeyPath) -> dict[str, object]:
        result: dict[str, object] = {}
        first: dict[str, Node] = {}
        for key, value in self._pairs(node):
            name = key.value
            if name in first:
                line = first[name].start_mark.line + 1
                self._problem(f"duplicate key {name!r} (first on line {line})", key)
                continue
            first[name] = key
            result[name] = self.value(value, (*path, name), key)
        for key, value in self._merged(node, len(path)):
            if key.value not in result:
                result[key.value] = self.value(value, (*path, key.value), key)
        return result

    def _pairs(self, node: MappingNode) -> Iterator[tuple[ScalarNode, Node]]:
        for key, value in node.value:
            if not isinstance(key, ScalarNode):
                self._problem("a key must be a name, not a list or a mapping", key)
            elif not _is_merge(key):
                yield key, value

    def _merged(self, node: MappingNode, depth: int) -> Iterator[tuple[ScalarNode, Node]]:
        """Yields the entries that `<<` merges; if two mappings have the same key, the first one counts."""
        self._enter(node, depth)
        for key, value in node.value:
            if not (isinstance(key, ScalarNode) and _is_merge(key)):
                continue
            for other in value.value if isinstance(value, SequenceNode) else [value]:
                if isinstance(other, MappingNode):
                    yield from self._pairs(other)
                    yield from self._merged(other, depth + 1)
                else:
                    self._problem("`<<` merges a mapping or a list of mappings", key)

    def _enter(self, node: Node, depth: int) -> None:
        self._visited += 1
        if depth > MAX_DEPTH:
            raise ConfigError([Problem(f"the file is nested deeper than {MAX_DEPTH} levels", self._mark(node))])
        if self._visited > MAX_VALUES:
            message = f"the file has more than {MAX_VALUES} values; aliases count each time they are used"
            raise ConfigError([Problem(message, self._mark(node))])

    def _check_tag(self, node: Node) -> None:
        known = {MappingNode: "tag:yaml.org,2002:map", SequenceNode: "tag:yaml.org,2002:seq", ScalarNode: _STRING_TAG}
        if node.tag and node.tag != known[type(node)]:
            tag = node.tag.replace("tag:yaml.org,2002:", "!!")
            self._problem(f"the tag {tag!r} is not supported; only !!str is, for text that looks like a number", node)

    def _problem(self, message: str, node: Node) -> None:
        self._document.problems.append(Problem(message, self._mark(node)))

    def _mark(self, node: Node) -> Mark:
        return Mark(self._source, node.start_mark.line + 1, node.start_mark.column + 1)


def _scalar(node: ScalarNode) -> object:
    text: str = node.value
    if _is_plain(node):
        return unquoted(text)
    # ROS treats a block scalar as unquoted.
    return ros_scalar(text) if node.style in ("|", ">") and node.tag != _STRING_TAG else text


def _is_plain(node: ScalarNode) -> bool:
    return not node.style and node.tag != _STRING_TAG


def _is_merge(key: ScalarNode) -> bool:
    return bool(key.value == "<<" and not key.style)
