"""Describes what the physics thread is doing, from its Python frames."""

import linecache
import sys
import sysconfig
import threading
from collections.abc import Iterator, Mapping
from types import FrameType
from typing import Any

from mjplug.physics.loop import Loop
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Host, Plugin
from mjplug.plugin.guard import Guard
from mjplug.server.server import Server
from mjplug.wire.session import WireSession
from mjplug.worker.supervisor import WorkerSupervisor

_STANDARD_LIBRARY = sysconfig.get_paths()["stdlib"]


def whereabouts(plugins: Mapping[str, Plugin[Any]], thread: threading.Thread | None = None) -> str:
    """Returns which part of the server the physics thread is running, and the place in its source.

    Args:
        plugins: The plugin instances by name.
        thread: The physics thread; None is the main thread.
    """
    frames = list(_frames((thread or threading.main_thread()).ident))
    if frames and frames[-1].f_code.co_name == "_shutdown":
        # The program has ended, and Python waits for threads.
        for other in threading.enumerate():
            if not other.daemon and other is not threading.main_thread():
                return f"the thread {other.name!r}{_place(list(_frames(other.ident)))}"
    return f"{_part(frames, plugins)}{_place(frames)}"


def _frames(ident: int | None) -> Iterator[FrameType]:
    """Yields the frames of a thread, the innermost first."""
    frame = sys._current_frames().get(ident or 0)
    while frame is not None:
        yield frame
        frame = frame.f_back


def _part(frames: list[FrameType], plugins: Mapping[str, Plugin[Any]]) -> str:
    names = {id(plugin): name for name, plugin in plugins.items()}
    for frame in frames:
        owner = frame.f_locals.get("self")
        if id(owner) in names:
            return f"plugin instance {names[id(owner)]!r}"
        match owner:
            case Host():
                return f"plugin instance {owner.name!r}"
            case Guard():
                return f"plugin instance {owner.name!r}"
            case WorkerSupervisor():
                return f"the worker process of {owner.name!r}"
            case WireSession():
                return "the Zenoh session"
            case Simulation():
                return "the physics step"
            case Loop():
                return "the physics loop"
        if frame.f_code is Server._start.__code__:
            return f"plugin instance {frame.f_locals['selected'].name!r}"
        if frame.f_code is Server._clean_up.__code__:
            return f"plugin instance {frame.f_locals['name']!r}"
    return "the server"


def _place(frames: list[FrameType]) -> str:
    """Returns the innermost place outside the standard library, because a place in `threading` says little."""
    own = (frame for frame in frames if not _is_standard(frame.f_code.co_filename))
    frame = next(own, frames[0] if frames else None)
    if frame is None:
        return ""
    file, line = frame.f_code.co_filename, frame.f_lineno
    source = linecache.getline(file, line).strip()
    return f" in {frame.f_code.co_name} ({file}, line {line}{f': {source}' if source else ''})"


def _is_standard(file: str) -> bool:
    return file.startswith((_STANDARD_LIBRARY, "<frozen")) and "site-packages" not in file
