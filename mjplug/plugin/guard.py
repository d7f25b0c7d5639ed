"""How a plugin's failure is contained: it is loud, and it follows the `on_plugin_error` policy. Physics thread only."""

import logging
from collections.abc import Callable
from time import perf_counter
from typing import ParamSpec, Protocol

from mjplug.errors import PluginError, is_fault
from mjplug.physics.loop import Loop
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.stopwatch import Stopwatch

P = ParamSpec("P")


class Stepping(Protocol):
    """The part of a plugin that the loop calls."""

    def update(self) -> None:
        """Runs before every step while active."""

    def on_reset(self) -> None:
        """Runs after every reset."""


class PluginStepper:
    """A plugin as the loop sees it; `update` is the plugin's own method, since it is called at every step."""

    def __init__(
        self, update: Callable[[], None], on_reset: Callable[[], None], failed: Callable[[BaseException], None]
    ) -> None:
        self.update = update
        self.on_reset = on_reset
        self.failed = failed


class Guard:
    """Stands between the server and one plugin's own work, times it, and switches it off when it fails.

    Attributes:
        disabled: Why the plugin was switched off; empty while it is not.
        holds: Velocity holds to release then.

    Args:
        name: The instance's name.
        logger: Where the failure is told.
        loop: The physics loop.
        stopwatch: Counts the time that the plugin takes.
        disable_on_error: Whether a failure switches the plugin off instead of stopping the server.
    """

    def __init__(
        self, name: str, logger: logging.Logger, loop: Loop, stopwatch: Stopwatch, disable_on_error: bool
    ) -> None:
        self.disabled = ""
        self.holds: list[VelocityHold] = []
        self._name = name
        self._logger = logger
        self._loop = loop
        self._stopwatch = stopwatch
        self._disable_on_error = disable_on_error
        self._stepper: PluginStepper | None = None

    @property
    def name(self) -> str:
        """The instance's name."""
        return self._name

    def attach(self, plugin: Stepping) -> None:
        """Adds the plugin to the loop's steppers, inactive."""
        stepper = self._stepper = PluginStepper(plugin.update, self.guarded(plugin.on_reset), self.fail)
        self._stopwatch.watch(stepper)
        self._loop.steppers.add(stepper)

    def activate(self) -> None:
        """Lets the loop update the plugin before every step, unless it was switched off."""
        if self._stepper is not None and not self.disabled:
            self._loop.steppers.activate(self._stepper)

    def deactivate(self) -> None:
        """Ends the updates."""
        if self._stepper is not None:
            self._loop.steppers.deactivate(self._stepper)

    def guarded(self, callback: Callable[P, None]) -> Callable[P, None]:
        """Wraps a piece of the plugin's work; it is not called any more once the plugin was switched off."""

        def call(*args: P.args, **kwargs: P.kwargs) -> None:
            if self.disabled:
                return
            began = perf_counter()
            try:
                callback(*args, **kwargs)
            except BaseException as error:
                if not is_fault(error):
                    raise
                self.fail(error)
            self._stopwatch.add(began)

        return call

    def fail(self, error: BaseException) -> None:
        """Switches the plugin off: its requests are refused and its holds released. Stops the server, if so wished."""
        name = self._name
        self._logger.error("plugin %s failed", name, exc_info=error)
        self.disabled = f"plugin {name} was switched off after an error: {error!r}"
        self.deactivate()
        for hold in self.holds:
            hold.release()
        self._loop.scheduler.cancel(self.disabled, owner=self)
        if not self._disable_on_error:
            self._loop.fail(PluginError(f"plugin {name} failed: {error!r} (on_plugin_error: stop)"))
