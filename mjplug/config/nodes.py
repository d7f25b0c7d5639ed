"""Parses YAML text to PyYAML's nodes; reports syntax errors with their place."""

import re
from typing import Any

import yaml
from yaml.events import CollectionEndEvent, CollectionStartEvent
from yaml.nodes import Node
from yaml.reader import ReaderError

from mjplug.config.problem import ConfigError, Mark, Problem, Source

try:
    from yaml import CSafeLoader as _SafeLoader
except ImportError:  # PyYAML built without libyaml: slower, otherwise the same
    from yaml import SafeLoader as _SafeLoader  # type: ignore[assignment]

MAX_DEPTH = 64
"""Maximum levels of nesting. The C parser recurses without a limit, and tens of thousands of levels crash the process.
"""

_SENTENCES = {
    "but found another document": "a second document begins here; a configuration file must contain one document",
    "second occurrence": "duplicate anchor",
}
"""Messages that replace incomplete sentences of libyaml."""


class _Loader(_SafeLoader):
    """Adds no tags to nodes, because YAML's rules for the type of a scalar differ from ROS's."""

    def resolve(self, kind: Any, value: Any, implicit: Any) -> str:
        """Returns no tag."""
        return ""


def compose(text: str, source: Source) -> Node | None:
    """Returns the root node; None if the text contains only comments.

    Raises:
        ConfigError: The text is not YAML, or is nested too deeply.
    """
    try:
        _refuse_deep_nesting(text, source)
        return _Loader(text).get_single_node()
    except ReaderError as error:
        raise ConfigError([_unreadable_character(error, text, source)]) from None
    except yaml.MarkedYAMLError as error:
        raise ConfigError([_syntax_problem(error, source)]) from None
    except UnicodeEncodeError as error:
        message = f"YAML syntax: the character {text[error.start]!r} is not allowed"
        raise ConfigError([Problem(message, _mark_at(text, error.start, source))]) from None


def _refuse_deep_nesting(text: str, source: Source) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                at = event.start_mark
                mark = Mark(source, at.line + 1, at.column + 1) if at else Mark(source)
                raise ConfigError([Problem(f"the file is nested deeper than {MAX_DEPTH} levels", mark)])
        elif isinstance(event, CollectionEndEvent):
            depth -= 1


def _syntax_problem(error: yaml.MarkedYAMLError, source: Source) -> Problem:
    at, start = error.problem_mark or error.context_mark, error.context_mark
    mark = _within(Mark(source, at.line + 1, at.column + 1)) if at else Mark(source)
    message = f"YAML syntax: {_SENTENCES.get(error.problem or '', error.problem)}"
    if error.context and start and error.problem not in _SENTENCES:
        message += f" {error.context}"
        message += f" that starts on line {start.line + 1}" if source.lines and start.line + 1 < mark.line else ""
    line = source.lines[mark.line - 1] if 0 < mark.line <= len(source.lines) else ""
    hint = ""
    if line[mark.column - 1 :].startswith("\t") or re.match(" *\t", line):
        hint = "indent with spaces; YAML does not allow tabs"
    elif re.search(r"(^|[\s,{\[:])\{ns\}[^\s,}\]]", line):
        hint = "write a name that begins with '{ns}' in quotes, such as \"{ns}/scan\""
    elif "mapping values are not allowed" in message:
        hint = "write text that contains ': ' in quotes"
    elif "undefined alias" in message:
        hint = "write text that begins with '*' in quotes"
    return Problem(message, mark, hint)


def _within(mark: Mark) -> Mark:
    """Moves a mark that is after the end of the text to the end of the last line that is not empty."""
    lines = mark.source.lines
    if not lines or (mark.line <= len(lines) and lines[mark.line - 1].strip()):
        return mark
    last = next((i for i in range(len(lines), 0, -1) if lines[i - 1].strip()), 1)
    return mark if mark.line < last else Mark(mark.source, last, len(lines[last - 1]) + 1)


def _unreadable_character(error: ReaderError, text: str, source: Source) -> Problem:
    # The error's position is not used, because it counts bytes in one parser and characters in the other.
    message = f"YAML syntax: the character U+{error.character:04X} is not allowed"
    return Problem(message, _mark_at(text, max(0, text.find(chr(error.character))), source))


def _mark_at(text: str, position: int, source: Source) -> Mark:
    if not source.lines:
        return Mark(source)
    before = re.split("\r\n|[\n\r\x85\u2028\u2029]", text[:position])
    return Mark(source, len(before), len(before[-1]) + 1)
