"""Zenoh callbacks of the server."""

from collections.abc import Callable
from typing import Any, TypeVar

from zenoh.handlers import Callback

from mjplug.log_scope import bound

T = TypeVar("T")


def callback(function: Callable[[T], Any]) -> "Callback[T]":
    """Returns a handler that calls a function on Zenoh's own thread, in the log scope of the calling server."""
    return Callback(bound(function), indirect=False)
