"""Message packages, made as they are imported, of definitions in `$AMENT_PREFIX_PATH/share/<package>/<kind>`."""

import importlib.abc
import importlib.machinery
import math
import os
import re
import sys
from ast import literal_eval
from pathlib import Path

NUMBERS = {
    "bool": ("?", "boolean"), "byte": ("B", "octet"), "char": ("B", "uint8"),
    "int8": ("b", "int8"), "uint8": ("B", "uint8"), "int16": ("h", "int16"), "uint16": ("H", "uint16"),
    "int32": ("i", "int32"), "uint32": ("I", "uint32"), "int64": ("q", "int64"), "uint64": ("Q", "uint64"),
    "float32": ("f", "float"), "float64": ("d", "double"),
}  # fmt: skip

_FIELD = re.compile(
    r"(?P<base>[\w/]+)(?:<=\d+)?(?P<array>\[(?P<bound><=)?(?P<count>\d*)\])?\s+(?P<name>\w+)\s*(?P<value>.*)"
)
_CONSTANT = re.compile(r"\w+\s+(?P<name>[A-Z][A-Z0-9_]*)\s*=\s*(?P<value>.*)")


class Field:
    """One field: its element's type (a number's name, "string" or a class), and None, a count or -1 for any number."""

    def __init__(self, name, base, count, default):
        self.name, self.base, self.count, self.default = name, base, count, default

    def initial(self):
        if self.default is not None:
            return self.default
        if self.count == -1:
            return []
        return self.zero() if self.count is None else [self.zero() for _ in range(self.count)]

    def zero(self):
        if self.base == "string":
            return ""
        if isinstance(self.base, str):
            return {"?": False, "f": 0.0, "d": 0.0}.get(NUMBERS[self.base][0], 0)
        return self.base()

    def check(self, value):
        elements = [value] if self.count is None else list(value)
        if self.count is not None and self.count >= 0 and len(elements) != self.count:
            raise AssertionError(f"{self.name} must have {self.count} elements")
        kind = str if self.base == "string" else self.base
        if kind in NUMBERS:
            kind = {"?": bool, "f": float, "d": float}.get(NUMBERS[kind][0], int)
        for element in elements:
            if not isinstance(element, kind) or (kind is int and isinstance(element, bool)):
                raise AssertionError(f"{self.name} must be of type {kind}, not {element!r}")

    @property
    def described(self):
        base = self.base if self.base == "string" else NUMBERS[self.base][1] if isinstance(self.base, str) else None
        base = base or "/".join(self.base.TYPE.split("/")[::2])
        return base if self.count is None else f"sequence<{base}>" if self.count == -1 else f"{base}[{self.count}]"


class Interface:
    """What all message classes have."""

    TYPE = ""
    FIELDS = ()

    def __init__(self, **kwargs):
        for field in self.FIELDS:
            setattr(self, field.name, kwargs.pop(field.name, field.initial()))
        assert not kwargs, f"Invalid arguments passed to constructor: {', '.join(kwargs)}"

    def __setattr__(self, name, value):
        field = next((field for field in self.FIELDS if field.name == name), None)
        if field is None:
            raise AttributeError(f"{self.TYPE} has no field {name!r}")
        field.check(value)
        super().__setattr__(name, value)

    def __eq__(self, other):
        return type(other) is type(self) and vars(self) == vars(other)

    __hash__ = None

    def __repr__(self):
        return f"{self.TYPE}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    @classmethod
    def get_fields_and_field_types(cls):
        return {field.name: field.described for field in cls.FIELDS}


def _message(type_name, text):
    constants, fields = {}, []
    for line in text.splitlines():
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        if found := _CONSTANT.fullmatch(bare):
            constants[found["name"]] = _literal(found["value"])
            continue
        found = _FIELD.fullmatch(bare)
        count = None if not found["array"] else -1 if found["bound"] or not found["count"] else int(found["count"])
        default = _literal(found["value"]) if found["value"] else None
        fields.append(Field(found["name"], _base(found["base"], type_name), count, default))
    name = type_name.rpartition("/")[2]
    return type(name, (Interface,), {"TYPE": type_name, "FIELDS": tuple(fields), **constants})


def _action(type_name, text):
    """The class of an action, with the derived types where rosidl puts them."""
    name = type_name.rpartition("/")[2]
    bodies = re.split(r"^---$", text, flags=re.MULTILINE)
    parts = {
        part: _message(f"{type_name}_{part}", body)
        for part, body in zip(("Goal", "Result", "Feedback"), bodies, strict=True)
    }
    goal_id = Field("goal_id", find("unique_identifier_msgs/msg/UUID"), None, None)

    def message(part, *fields):
        return type(f"{name}_{part}", (Interface,), {"TYPE": f"{type_name}_{part}", "FIELDS": fields})

    def service(part, request, response):
        members = {"Request": message(f"{part}_Request", *request), "Response": message(f"{part}_Response", *response)}
        return type(f"{name}_{part}", (), {"TYPE": f"{type_name}_{part}", **members})

    stamp = Field("stamp", find("builtin_interfaces/msg/Time"), None, None)
    accepted = (Field("accepted", "bool", None, None), stamp)
    ended = (Field("status", "int8", None, None), Field("result", parts["Result"], None, None))
    members = {
        "SendGoalService": service("SendGoal", (goal_id, Field("goal", parts["Goal"], None, None)), accepted),
        "GetResultService": service("GetResult", (goal_id,), ended),
        "FeedbackMessage": message("FeedbackMessage", goal_id, Field("feedback", parts["Feedback"], None, None)),
        "CancelGoalService": find("action_msgs/srv/CancelGoal"),
        "GoalStatusMessage": find("action_msgs/msg/GoalStatusArray"),
    }
    return type(name, (), {"TYPE": type_name, "Impl": type("Impl", (), members), **parts})


def _base(text, user):
    if text in NUMBERS or text == "string":
        return text
    package, _, name = text.rpartition("/")
    return find(f"{package or user.split('/')[0]}/msg/{name}")


def _literal(text):
    return (
        {"true": True, "false": False, "nan": math.nan}.get(text)
        if text in ("true", "false", "nan")
        else literal_eval(text)
    )


def find(type_name):
    """Returns the class of a type, for the tests."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def _shares(package):
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [share for prefix in prefixes if prefix and (share := Path(prefix, "share", package)).is_dir()]


class _Loader(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, fullname, path, target=None):
        package, _, kind = fullname.partition(".")
        shares = _shares(package)
        if not shares or kind not in ("", "msg", "srv", "action") or (kind and not (shares[0] / kind).is_dir()):
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=not kind)

    def create_module(self, spec):
        return None

    def exec_module(self, module):
        package, _, kind = module.__name__.partition(".")
        if kind:
            share = _shares(package)[0]
            module.__getattr__ = lambda name: _load(module, share / kind / f"{name}.{kind}", f"{package}/{kind}/{name}")


def _load(module, path, type_name):
    if not path.is_file():
        raise AttributeError(type_name)
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".msg":
        made = _message(type_name, text)
    elif path.suffix == ".action":
        made = _action(type_name, text)
    else:
        request, response = (_message(f"{type_name}_{part}", body) for part, body in zip(
            ("Request", "Response"), re.split(r"^---$", text, flags=re.MULTILINE), strict=True))  # fmt: skip
        made = type(path.stem, (), {"TYPE": type_name, "Request": request, "Response": response})
    setattr(module, path.stem, made)
    return made


def install():
    if not any(isinstance(finder, _Loader) for finder in sys.meta_path):
        sys.meta_path.append(_Loader())
