"""YAML text of values, from which mjplug reads the same values."""

import json
import math
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel


def scalar(value: Any) -> str:
    """Returns a value on one line: a scalar, or a list or mapping in flow style."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value).replace("inf", ".inf").replace("nan", ".nan")
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_key(key)}: {scalar(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple | set | frozenset):
        return f"[{', '.join(map(scalar, value))}]"
    return text(value) if isinstance(value, str) else str(value)


def text(value: str) -> str:
    """Returns a string, in quotes unless YAML reads the same string without quotes."""
    from mjplug.config.document import unquoted

    plain = value.strip() == value and all(c.isalnum() or c in "_-./:" for c in value) and not value.endswith(":")
    safe = (plain and value[:1].isalpha()) or (plain and value.startswith("/"))
    return value if safe and unquoted(value) == value else json.dumps(value, ensure_ascii=False)


def block(value: Mapping[str, Any], indent: str = "") -> list[str]:
    """Returns the lines of a mapping in block style."""
    lines = []
    for key, item in value.items():
        if isinstance(item, Mapping) and item:
            lines += [f"{indent}{_key(key)}:", *block(item, f"{indent}  ")]
        else:
            lines.append(f"{indent}{_key(key)}: {scalar(item)}")
    return lines


def _key(key: object) -> str:
    return text(str(key))
