"""The configuration in effect, with where each value comes from."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from mjplug.cli.yaml_text import scalar
from mjplug.config.document import KeyPath
from mjplug.config.draft import Loaded
from mjplug.config.instance_names import has_documented_names
from mjplug.plugin.selection import Selected
from mjplug_schemas.names import NAMESPACE

_COLUMN = 40
"""Column of the origins, unless a line is longer."""


def effective(loaded: Loaded, plugins: Sequence[Selected]) -> Iterator[str]:
    """Yields the lines of a complete configuration file; a comment after each value names its origin."""
    settings = loaded.settings
    for name in type(settings).model_fields:
        value = getattr(settings, name)
        if name == "plugins":
            yield "plugins:" if plugins else "plugins: {}"
            for plugin in plugins:
                yield from _plugin(loaded, plugin)
        elif isinstance(value, BaseModel):
            yield f"{name}:"
            yield from _section(loaded, value, (name,), "  ")
        elif name != "ros_params":
            # The plugins in these files are part of `plugins` already.
            yield _line(loaded, (name,), "", value)


def _plugin(loaded: Loaded, plugin: Selected) -> Iterator[str]:
    path = ("plugins", plugin.name)
    yield f"  {plugin.name}:"
    entry = loaded.settings.plugins[plugin.name]
    for name in type(entry).model_fields:
        # If it is not set, the value of the server applies.
        if (value := getattr(entry, name)) is not None:
            yield _line(loaded, (*path, name), "    ", value)
    yield from _section(loaded, plugin.parameters, path, "    ", has_documented_names(entry))


def _section(
    loaded: Loaded, section: BaseModel, path: KeyPath, indent: str, documented_names: bool = False
) -> Iterator[str]:
    values: dict[str, Any] = {name: getattr(section, name) for name in type(section).model_fields}
    for name, value in {**values, **(section.__pydantic_extra__ or {})}.items():
        # A parameter without a value is derived from others; `null` would not express that.
        if value is not None:
            yield _line(loaded, (*path, name), indent, _absolute(value) if documented_names else value)


def _absolute(value: Any) -> Any:
    """Returns a value with default names as they are in effect, `/scan` for `{ns}/scan`.

    Otherwise the printed `{ns}` would count as the user's, and the names would move when the output is served.
    """
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, Mapping):
        return {key: _absolute(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_absolute(item) for item in value]
    return value.removeprefix(NAMESPACE) if isinstance(value, str) else value


def _line(loaded: Loaded, path: KeyPath, indent: str, value: Any) -> str:
    mark = loaded.origin(path)
    origin = "default" if mark is None else f"{mark.source.name}:{mark.line}" if mark.line else mark.source.name
    return f"{f'{indent}{path[-1]}: {scalar(value)}':<{_COLUMN}}  # {origin}"
