"""Tools to test plugins and programs that use mjplug.

`World` steps plugins without a network and without threads; a test with it takes milliseconds. A test of a whole server
uses `mjplug.open_server`, or the pytest fixture `mjplug_server`.
"""

from typing import TYPE_CHECKING

__all__ = [
    "FakeGoal",
    "FakePublisher",
    "FakeTransport",
    "InlineWorker",
    "InlineWorkerPool",
    "LocalCall",
    "World",
    "assert_message",
]

if TYPE_CHECKING:
    from mjplug.server.local_calls import LocalCall
    from mjplug.testing.goals import FakeGoal
    from mjplug.testing.messages import assert_message
    from mjplug.testing.transport import FakePublisher, FakeTransport
    from mjplug.testing.workers import InlineWorker, InlineWorkerPool
    from mjplug.testing.world import World
else:
    _MODULES = {
        "FakeGoal": "goals",
        "FakePublisher": "transport",
        "FakeTransport": "transport",
        "InlineWorker": "workers",
        "InlineWorkerPool": "workers",
        "World": "world",
        "assert_message": "messages",
    }

    def __getattr__(name):
        # Imported when it is used: pytest loads the plugin in this package at every start.
        from importlib import import_module  # noqa: PLC0415

        if name == "LocalCall":
            return import_module("mjplug.server.local_calls").LocalCall
        if name in _MODULES:
            return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
