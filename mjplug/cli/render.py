"""Messages as text: YAML for people, JSON for programs, CSV for tables."""

import base64
import csv
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from mjplug.cli.output import Format
from mjplug_schemas.message import Message

_MAX_WIDTH = 1 << 30
"""Maximum width of a line; long strings are not wrapped."""

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


@dataclass(frozen=True, slots=True)
class Rendering:
    """Format options for messages.

    Attributes:
        format: `yaml`, `json` or `csv`.
        most: Maximum number of list elements and of characters of a string in YAML; 0 for no limit.
        arrays: Whether lists are shown.
        texts: Whether strings are shown.
        flow: Whether YAML is written on one line.
    """

    format: Format = "yaml"
    most: int = 0
    arrays: bool = True
    texts: bool = True
    flow: bool = False

    def text(self, value: Any) -> str:
        """Returns a message or a field as text, without a line break at the end."""
        if self.format == "json":
            if isinstance(value, Message) and self.arrays and self.texts:
                return value.to_json().decode()
            return json.dumps(self._plain(value, 0))
        if self.format == "csv":
            return _row(leaf for _, leaf in _leaves("", self._plain(value, 0)))
        plain = self._plain(value, self.most)
        if isinstance(plain, str):
            return plain
        if not isinstance(plain, dict | list):
            return _scalar(plain)
        flow = True if self.flow else (None if plain in ([], {}) else False)
        text = yaml.dump(
            plain, Dumper=_Dumper, sort_keys=False, default_flow_style=flow, allow_unicode=True, width=_MAX_WIDTH
        )
        return str(text).rstrip("\n")

    def heading(self, value: Any, name: str = "") -> str:
        """Returns the names of the CSV columns of a value.

        Args:
            value: The value.
            name: The path of the value in its message: `ranges` gives `ranges[0],ranges[1]`.
        """
        return _row(leaf or "value" for leaf, _ in _leaves(name, self._plain(value, 0)))

    def _plain(self, value: Any, most: int) -> Any:
        if isinstance(value, Message):
            return {name: self._plain(getattr(value, name), most) for name in type(value).model_fields}
        if isinstance(value, dict):
            return {name: self._plain(item, most) for name, item in value.items()}
        if isinstance(value, bytes) and self.format == "json" and self.arrays:
            return base64.b64encode(value).decode()
        if isinstance(value, tuple | list | bytes):
            if not self.arrays:
                return f"<{len(value)} values>"
            shown = value[:most] if most and len(value) > most else value
            return [self._plain(item, most) for item in shown] + (["..."] if len(shown) < len(value) else [])
        if isinstance(value, str):
            if not self.texts:
                return f"<{len(value)} characters>"
            return f"{value[:most]}..." if most and len(value) > most else value
        return value


def _scalar(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(f"{name}.{key}" if name else key, item)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _leaves(f"{name}[{index}]", item)
    else:
        yield name, _scalar(value) if isinstance(value, bool) else value


def _row(cells: Iterator[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(list(cells))
    return text.getvalue()
