"""Expressions that select messages: `--filter 'm.linear.x > 0.5 and len(m.name) > 0'`.

Expressions have Python's syntax, as in ros2, but `eval` is not used: this module evaluates comparisons and arithmetic,
and refuses everything else. An expression that is copied from a web page can neither read files nor run programs.
"""

import ast
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

from mjplug.client import WrongTypeError
from mjplug.errors import did_you_mean

_MAX_LENGTH = 1000
"""Maximum number of characters of an expression; it also limits how deeply an expression can be nested."""


def _round(value: float, digits: int = 0) -> float:
    """Returns a rounded number; `round` itself computes powers of ten of any size for integers."""
    return round(float(value), digits)


def _sum(values: Iterable[float]) -> float:
    """Returns the sum of numbers; `sum` itself also joins lists, which could fill the memory."""
    total: float = 0
    for value in values:
        total += value
    return total


_OPERATORS: Final[Mapping[type[ast.AST], Callable[..., Any]]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod,
    ast.UAdd: operator.pos, ast.USub: operator.neg, ast.Not: operator.not_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
}  # fmt: skip

_FUNCTIONS: Final[Mapping[str, Callable[..., Any]]] = {
    "abs": abs, "all": all, "any": any, "bool": bool, "float": float, "int": int, "len": len, "max": max, "min": min,
    "round": _round, "sum": _sum, "isfinite": math.isfinite, "isinf": math.isinf, "isnan": math.isnan,
    "hypot": math.hypot, "sqrt": math.sqrt,
}  # fmt: skip
FUNCTIONS = tuple(_FUNCTIONS)
"""The functions that an expression can call."""

METHODS: Final = ("endswith", "lower", "startswith", "upper")
"""The methods of strings that an expression can call."""


class MessageFilter:
    """An expression that is evaluated for each message; the message is called `m`.

    Args:
        text: The expression.

    Raises:
        WrongTypeError: The text is not an expression, or contains a part that is not allowed.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        if len(text) > _MAX_LENGTH:
            raise WrongTypeError(f"the filter has {len(text)} characters; at most {_MAX_LENGTH} are allowed")
        try:
            self._root = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise WrongTypeError(
                f"the filter {text!r} is not an expression ({getattr(error, 'msg', error)}); "
                "write it as in 'm.linear.x > 0.5', where m is the message"
            ) from None
        for node in ast.walk(self._root):
            self._check(node)

    def __call__(self, message: Any) -> bool:
        """Returns whether the expression selects a message.

        Raises:
            WrongTypeError: The expression cannot be evaluated for this message.
        """
        try:
            return bool(self._value(self._root, {"m": message}))
        except WrongTypeError:
            raise
        except (TypeError, ValueError, ArithmeticError, LookupError, RecursionError) as error:
            raise WrongTypeError(f"the filter {self._text!r} cannot be evaluated: {error}") from None

    def _check(self, node: ast.AST) -> None:
        allowed = (
            ast.Name, ast.Attribute, ast.Subscript, ast.Slice, ast.Constant, ast.BoolOp, ast.UnaryOp, ast.BinOp,
            ast.Compare, ast.Call, ast.IfExp, ast.List, ast.Tuple, ast.GeneratorExp, ast.comprehension,
            ast.expr_context, ast.boolop, *_OPERATORS,
        )  # fmt: skip
        if not isinstance(node, allowed):
            raise self._refusal(f"{type(node).__name__} is not allowed")
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            raise self._refusal(f"no field of a message is called {node.attr!r}")
        if isinstance(node, ast.Call):
            self._check_call(node)

    def _part(self, node: ast.AST) -> str:
        return ast.get_source_segment(self._text.strip(), node) or self._text

    def _check_call(self, node: ast.Call) -> None:
        known = isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS
        method = isinstance(node.func, ast.Attribute) and node.func.attr in METHODS
        if node.keywords or not (known or method):
            raise self._refusal(
                f"{self._part(node)!r} cannot be called; allowed: {', '.join(FUNCTIONS)}, "
                f"and for strings {', '.join(METHODS)}"
            )

    def _value(self, node: Any, names: Mapping[str, Any]) -> Any:
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                if node.id not in names:
                    raise self._refusal(f"unknown name {node.id!r}; the message is called m")
                return names[node.id]
            case ast.Attribute():
                return self._field(self._value(node.value, names), node.attr)
            case ast.Subscript():
                return self._value(node.value, names)[self._value(node.slice, names)]
            case ast.Slice():
                parts = (node.lower, node.upper, node.step)
                return slice(*(None if part is None else self._value(part, names) for part in parts))
            case ast.BoolOp():
                # As in Python, evaluation stops at the first value that decides the result.
                ends = isinstance(node.op, ast.Or)
                value = None
                for part in node.values:
                    value = self._value(part, names)
                    if bool(value) is ends:
                        break
                return value
            case ast.UnaryOp():
                return _OPERATORS[type(node.op)](self._value(node.operand, names))
            case ast.BinOp():
                return self._calculated(node.op, self._value(node.left, names), self._value(node.right, names))
            case ast.Compare():
                left = self._value(node.left, names)
                for operation, comparator in zip(node.ops, node.comparators, strict=True):
                    right = self._value(comparator, names)
                    if not _OPERATORS[type(operation)](left, right):
                        return False
                    left = right
                return True
            case ast.IfExp():
                return self._value(node.body if self._value(node.test, names) else node.orelse, names)
            case ast.List() | ast.Tuple():
                return tuple(self._value(element, names) for element in node.elts)
            case ast.GeneratorExp():
                return self._each(node, names)
        assert isinstance(node, ast.Call)
        arguments = [self._value(argument, names) for argument in node.args]
        if isinstance(node.func, ast.Name):
            return _FUNCTIONS[node.func.id](*arguments)
        assert isinstance(node.func, ast.Attribute)
        text = self._value(node.func.value, names)
        if not isinstance(text, str):
            raise self._refusal(f"{node.func.attr} works on strings only")
        return getattr(text, node.func.attr)(*arguments)

    def _each(self, node: ast.GeneratorExp, names: Mapping[str, Any]) -> Iterator[Any]:
        if len(node.generators) != 1 or not isinstance(node.generators[0].target, ast.Name):
            raise self._refusal("only one `for` with one variable is allowed")
        (each,) = node.generators
        assert isinstance(each.target, ast.Name)
        for value in self._value(each.iter, names):
            inner = {**names, each.target.id: value}
            if all(self._value(condition, inner) for condition in each.ifs):
                yield self._value(node.elt, inner)

    def _calculated(self, operation: ast.operator, left: Any, right: Any) -> Any:
        # The product of a string or list and a number could fill the memory, and `%` formats a string.
        if not all(isinstance(value, int | float) for value in (left, right)):
            raise self._refusal(f"{type(operation).__name__} works on numbers only")
        return _OPERATORS[type(operation)](left, right)

    def _field(self, value: Any, name: str) -> Any:
        fields = list(value) if isinstance(value, dict) else list(getattr(type(value), "model_fields", ()))
        if name not in fields:
            there = f"known: {', '.join(fields)}" if fields else f"{type(value).__name__} has no fields"
            raise self._refusal(f"there is no field {name!r}{did_you_mean(name, fields)}; {there}")
        return value[name] if isinstance(value, dict) else getattr(value, name)

    def _refusal(self, why: str) -> WrongTypeError:
        return WrongTypeError(f"the filter {self._text!r} cannot be used: {why}")
