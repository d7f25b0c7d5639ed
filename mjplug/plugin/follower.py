"""Makes a plugin instance follow changes of the model."""

from dataclasses import replace
from logging import Logger
from typing import Any, Protocol, runtime_checkable

from mjplug.errors import MjplugError, is_fault
from mjplug.physics.model_change import ModelChange
from mjplug.physics.part import SavedPart
from mjplug.plugin.guard import Guard
from mjplug.plugin.instance_part import InstancePart


class Restartable(Protocol):
    """The part of the host that a restart needs."""

    logger: Logger

    def _release(self) -> None:
        """Releases what the plugin has created."""


@runtime_checkable
class Following(Protocol):
    """The part of a plugin that follows changes of the model."""

    def init(self, host: Any, parameters: Any) -> None:
        """Starts the plugin."""

    def on_reset(self) -> None:
        """Discards data about the old state."""

    def on_model_changed(self, change: ModelChange) -> None:
        """Follows a change."""

    def cleanup(self) -> None:
        """Releases resources."""


class Follower:
    """Saves the state of a plugin before a change of the model, and restores it afterwards. Physics thread only.

    Args:
        plugin: The plugin.
        parameters: Its parameters.
        host: Its host.
        guard: Its guard.
        part: Its part of saved states.
    """

    def __init__(self, plugin: Following, parameters: Any, host: Restartable, guard: Guard, part: InstancePart) -> None:
        self._plugin = plugin
        self._parameters = parameters
        self._host = host
        self._guard = guard
        self._part = part
        self._saved: SavedPart | None = None
        # Why the instance does not fit the model; it may fit the next one.
        self._unfit = ""

    def prepare(self) -> None:
        """Saves the state of the plugin."""
        self._saved = None if self._guard.disabled else self._part.save()

    def follow(self, change: ModelChange) -> None:
        """Calls `on_model_changed`."""
        guard = self._guard
        if guard.disabled and guard.disabled != self._unfit:
            # It failed before, and stays disabled.
            return
        guard.disabled = self._unfit = ""
        guard.guarded(self._plugin.on_model_changed)(replace(change, restart=self._restart))

    def _restart(self) -> None:
        guard, plugin = self._guard, self._plugin
        timers = guard.begin_again()
        self._clean_up()
        self._host._release()
        try:
            plugin.init(self._host, self._parameters)
        except MjplugError as error:
            self._disable(f"plugin {guard.name} does not fit the changed model: {error}")
        except BaseException as error:
            if not is_fault(error):
                raise
            guard.report("restarting it for the changed model failed", error)
            self._disable(f"plugin {guard.name} failed with the changed model: {error!r}")
        else:
            self._restore()
        guard.end_again(timers)

    def _restore(self) -> None:
        saved, part = self._saved, self._part
        if saved is None:
            return
        reason = part.check(saved) or part.restore(saved)
        if reason:
            self._host.logger.warning("its state ended with the change of the model: %s", reason)
            self._plugin.on_reset()

    def _disable(self, reason: str) -> None:
        self._host._release()
        for timer in self._guard.timers.values():
            timer.cancel()
        self._guard.disable(reason)
        self._unfit = reason

    def _clean_up(self) -> None:
        try:
            self._plugin.cleanup()
        except BaseException as error:
            if not is_fault(error):
                raise
            self._guard.report("cleanup failed", error)
