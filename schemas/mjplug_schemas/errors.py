"""Errors about messages, type names and ROS names."""

from collections.abc import Iterable

_LONGEST = 200
"""Characters up to which a similar name is looked for: that takes quadratic time."""


class SchemaError(ValueError):
    """Base class of all errors that mjplug_schemas raises."""


class CodecError(SchemaError):
    """Bytes that are not a valid message, or a message that cannot be encoded; the text names the field."""


class DefinitionError(SchemaError):
    """A message or service class that cannot be written as a ROS interface definition."""


class NameRuleError(SchemaError):
    """A name that breaks a ROS 2 rule."""


class UnknownType(SchemaError, KeyError):
    """A ROS type that is not defined.

    Args:
        name: The requested type.
        known: The defined types.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        packages = sorted({type_name.split("/")[0] for type_name in known})
        super().__init__(f"unknown type {name!r}{_meant(name, known)}; known packages: {', '.join(packages)}")

    # KeyError would show the text in quotes.
    __str__ = Exception.__str__


def _meant(name: str, known: list[str]) -> str:
    """Returns the suggestion for a type: one whose package was left out or is another one, or a similar one."""
    last = name.rpartition("/")[2].casefold()
    same = [type_name for type_name in known if type_name.rpartition("/")[2].casefold() == last]
    if not same and "/" not in name:
        by_last = {type_name.rpartition("/")[2]: type_name for type_name in reversed(known)}
        import difflib  # noqa: PLC0415  (the TAB key of a shell waits for this module)

        close = difflib.get_close_matches(name, by_last, n=1) if len(name) <= _LONGEST else []
        same = [by_last[short] for short in close]
    if not same:
        return did_you_mean(name, known)
    return f", did you mean {' or '.join(map(repr, same))}?"


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Returns `, did you mean 'x'?` for a name close to an allowed one, otherwise an empty string."""
    import difflib  # noqa: PLC0415

    close = difflib.get_close_matches(name, list(allowed), n=1) if len(name) <= _LONGEST else []
    return f", did you mean {close[0]!r}?" if close else ""
