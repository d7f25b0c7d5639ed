"""Paths to a field of a message, as for `--field`: `pose.pose.position`, `ranges[3]`, `free_joints[0].name`."""

import re
from typing import Any

from mjplug.client import WrongTypeError
from mjplug.errors import did_you_mean
from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

_PART = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+)\]")


class FieldPath:
    """A path into a message.

    Args:
        text: The path.

    Raises:
        WrongTypeError: The text is not a path.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.parts: list[str | int] = []
        at = 0
        while at < len(text):
            part = _PART.match(text, at)
            if part is None:
                raise WrongTypeError(f"{text!r} is not a field; write it as in pose.position or ranges[3]")
            self.parts.append(part[1] or int(part[2]))
            at = part.end()

    def check(self, kind: Any) -> None:
        """Checks that messages of a type have this field, as far as the type determines it.

        Raises:
            WrongTypeError: They do not have this field; the message lists the known fields.
        """
        if kind is dict:
            return
        for part in self.parts:
            if isinstance(part, int):
                continue
            known = {field.name: field for field in fields(kind)} if not isinstance(kind, Primitive) else {}
            if part not in known:
                of = f"{kind.name} is not a message" if isinstance(kind, Primitive) else f"known: {', '.join(known)}"
                raise WrongTypeError(f"{self.text!r}: there is no field {part!r}{did_you_mean(part, known)}; {of}")
            kind = known[part].element

    def get(self, message: Any) -> Any:
        """Returns the value of the field.

        Raises:
            WrongTypeError: This message has no such element.
        """
        value = message
        for part in self.parts:
            try:
                value = value[part] if isinstance(part, int) or isinstance(value, dict) else getattr(value, part)
            except (IndexError, KeyError, TypeError, AttributeError):
                raise WrongTypeError(f"{self.text!r}: this message has no {part!r} there") from None
        return value
