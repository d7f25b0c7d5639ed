"""The window of MuJoCo 3: `mujoco.viewer.launch_passive`."""

import threading
from importlib import import_module
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

import mujoco

from mjplug.window.controls import Controls
from mjplug.window.interrupt import DelayedInterrupt
from mjplug.window.served import Served
from mjplug.window.stream import State

_SPACE, _RIGHT, _BACKSPACE = 32, 262, 259
"""Codes of keys, as in GLFW."""

_PERIOD = 1.0 / 60.0
_TEXT_PERIOD = 0.1
_CLOSE_TIMEOUT = 5.0
"""How long to wait until the window is closed [s]; otherwise, its thread may crash at the end of the process."""


def show(served: Served) -> None:
    """Shows the states of a server until the user closes the window.

    Args:
        served: The server.

    Raises:
        WindowError: The states do not fit the model.
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    # Not at the top, because it loads GLFW, which needs a screen. MuJoCo's stubs lack it.
    viewers: Any = import_module("mujoco.viewer")

    model, feed = served.model, served.feed
    data = mujoco.MjData(model)
    keys: SimpleQueue[int] = SimpleQueue()
    before = set(threading.enumerate())
    with DelayedInterrupt() as interrupt:
        viewer = viewers.launch_passive(model, data, key_callback=keys.put, show_left_ui=False, show_right_ui=False)
        try:
            shown = 0.0
            while viewer.is_running() and not interrupt.requested:
                state = feed.load(data, _PERIOD)
                with viewer.lock():
                    served.drag.update(model, viewer.perturb)
                viewer.sync()
                if state is not None:
                    _handle_keys(keys, state, served.controls)
                    if monotonic() - shown >= _TEXT_PERIOD:
                        shown = monotonic()
                        _describe(viewer, served.name, state, feed.silent)
        finally:
            viewer.close()
            for thread in set(threading.enumerate()) - before:
                if thread.daemon and thread is not threading.current_thread():
                    thread.join(_CLOSE_TIMEOUT)


def _handle_keys(keys: "SimpleQueue[int]", state: State, controls: Controls) -> None:
    while True:
        try:
            key = keys.get_nowait()
        except Empty:
            return
        if key == _SPACE:
            controls.pause(not state.paused)
        elif key == _BACKSPACE:
            controls.reset()
        elif key == _RIGHT and state.paused:
            controls.step()


def _describe(viewer: Any, name: str, state: State, silent: bool) -> None:
    """Writes the state of the simulation into the window, if this version of MuJoCo can."""
    if not hasattr(viewer, "set_texts"):
        return
    status = "no answer" if silent else "paused" if state.paused else "running"
    left, right = "server\nstate\ntime\nresets", f"{name}\n{status}\n{state.time:.3f} s\n{state.epoch}"
    viewer.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPRIGHT, left, right))
