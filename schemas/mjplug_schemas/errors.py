"""What can go wrong with a message, a type name or a ROS name."""

import difflib
from collections.abc import Iterable


class SchemaError(ValueError):
    """Root of every error that mjplug_schemas raises on purpose."""


class CodecError(SchemaError):
    """Bytes that are not the message they should be, or a message that cannot be written; one sentence says where."""


class DefinitionError(SchemaError):
    """A message or service class that no ROS interface definition could describe."""


class NameRuleError(SchemaError):
    """A name that breaks a ROS 2 rule."""


class UnknownType(SchemaError, KeyError):
    """A ROS type that no module here defines.

    Args:
        name: The type that was asked for.
        known: The types there are.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        packages = sorted({type_name.split("/")[0] for type_name in known})
        super().__init__(f"unknown type {name!r}{did_you_mean(name, known)}; known packages: {', '.join(packages)}")

    # KeyError would show the sentence in quotes.
    __str__ = Exception.__str__


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Returns `, did you mean 'x'?` for a name close to an allowed one, otherwise an empty string."""
    # Close matching takes quadratic time, and the name may be megabytes that somebody sent.
    close = difflib.get_close_matches(name, list(allowed), n=1) if len(name) <= 200 else []
    return f", did you mean {close[0]!r}?" if close else ""
