"""The window of MuJoCo 4 and later: MuJoCo Studio."""

import mujoco
from mujoco.studio import app, launch_passive, messages, plugin, sim, sim_history, viewer_protocol

from mjplug.window.controls import Controls
from mjplug.window.drag import Drag
from mjplug.window.served import Served
from mjplug.window.stream import State

_PERIOD = 1.0 / 60.0
_PERCENT = 100.0

_GRAPHICS = "opengl_headless"
"""Studio draws into memory and then into its window; without this, 4.0.0 raises `Target not found`."""


def show(served: Served) -> None:
    """Shows the states of a server until the user closes the window.

    Args:
        served: The server.

    Raises:
        WindowError: The states do not fit the model.
    """
    config = viewer_protocol.ViewerConfig(title=f"{served.name} - mjplug", gfx=_GRAPHICS)
    model, server = served.model, _Server(served.model, served.controls)
    with launch_passive.launch(config, plugins=[app.App(), _Dragging(model, served.drag), server]) as handle:
        data = mujoco.MjData(model)
        handle.set_model(model, data=data)
        while handle.is_running():
            state = served.feed.load(data, _PERIOD)
            if state is not None:
                server.mirror(state)
            handle.sync()


class _Dragging(plugin.ViewerPlugin):
    """Sends what the user drags, for each drawn frame; runs on the window's thread."""

    def __init__(self, model: mujoco.MjModel, drag: Drag) -> None:
        self._model = model
        self._drag = drag

    @messages.handler
    def on_update(self, event: messages.UpdateEvent) -> None:
        """Sends the perturbation of the window."""
        self._drag.update(self._model, self.viewer.perturb)


class _Server(plugin.SimPlugin):
    """Passes on to the server what the window asks of its simulation, and ignores what a server cannot do.

    A handler that returns True keeps the window from changing its own copy of the simulation.
    """

    def __init__(self, model: mujoco.MjModel, controls: Controls) -> None:
        self._model = model
        self._controls = controls
        # None: not known yet.
        self._paused: bool | None = None
        self._speed = _PERCENT

    def mirror(self, state: State) -> None:
        """Shows in the window whether the server is paused."""
        if state.paused == self._paused:
            return
        self._paused = state.paused
        pause = sim.PauseState.NORMAL_PAUSED if state.paused else sim.PauseState.UNPAUSED
        self.handle.send_to_viewer(messages.StepControlSnapshot(pause_state=pause, speed=self._speed))
        # With a history of one frame, the right arrow takes a step.
        history = sim_history.SimHistorySnapshot(size=1, head_time=state.time, tail_time=state.time)
        self.handle.send_to_viewer(history)

    @messages.handler
    def on_step_control(self, event: messages.StepControlSnapshot) -> bool:
        """Pauses, resumes or sets the speed."""
        self._pause(event.pause_state)
        if event.speed != self._speed:
            self._speed = event.speed
            self._controls.set_speed(event.speed / _PERCENT)
        return True

    @messages.handler
    def on_pause(self, event: messages.RequestPauseEvent) -> bool:
        """Pauses or resumes."""
        self._pause(event.pause_state)
        return True

    @messages.handler
    def on_single_step(self, event: messages.SingleStepEvent) -> bool:
        """Steps."""
        self._controls.step()
        return True

    @messages.handler
    def on_reset(self, event: messages.ResetEvent) -> bool:
        """Resets, to a keyframe if one was chosen."""
        key = -1 if event.key is None else event.key
        self._controls.reset(self._model.key(key).name if 0 <= key < self._model.nkey else "")
        return True

    @messages.handler
    def on_perturb(self, event: messages.PerturbSnapshot) -> bool:
        """Ignores forces that the window computes; the server applies the spring itself."""
        return True

    @messages.handler
    def on_state(self, event: messages.StateEvent) -> bool:
        """Ignores changes of the state, such as by sliders of joints."""
        return True

    @messages.handler
    def on_load(self, event: messages.LoadModelEvent) -> bool:
        """Ignores other models."""
        return True

    @messages.handler
    def on_options(self, event: messages.MjOptionSnapshot) -> bool:
        """Ignores options of the physics."""
        return True

    @messages.handler
    def on_keyframe(self, event: messages.KeyframeEvent) -> bool:
        """Ignores new keyframes."""
        return True

    @messages.handler
    def on_threads(self, event: messages.ThreadPoolEvent) -> bool:
        """Ignores the number of threads."""
        return True

    @messages.handler
    def on_history(self, event: sim_history.SimHistorySnapshot) -> bool:
        """Ignores the time line, because a server does not go back."""
        return True

    def _pause(self, pause: sim.PauseState) -> None:
        paused = pause != sim.PauseState.UNPAUSED
        if paused != self._paused:
            # Shown at once; the next state corrects it if the server refuses.
            self._paused = paused
            self._controls.pause(paused)
