"""Zenoh callbacks, on threads that keep their Python data."""

import ctypes
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from zenoh.handlers import Callback

from mjplug.log_scope import bound

T = TypeVar("T")

_thread = threading.local()


def callback(function: Callable[[T], Any]) -> "Callback[T]":
    """Returns a handler that calls a function on Zenoh's own thread, in the log scope of the calling server."""
    scoped = bound(function)

    def call(item: T) -> None:
        keep_thread_state()
        scoped(item)

    return Callback(call, indirect=False)


def keep_thread_state() -> None:
    """Makes Python keep its data about the calling thread until the thread ends.

    Python has none about Zenoh's threads. Each callback would allocate memory for them and release it again, which
    takes longer than a short callback itself. Zenoh has few threads, and keeps them.
    """
    if not hasattr(_thread, "kept"):
        # Never released; that of the callback then does not delete the data.
        ctypes.pythonapi.PyGILState_Ensure()
        _thread.kept = True
