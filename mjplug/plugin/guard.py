"""Handles exceptions of plugins: logs them and applies the `on_plugin_error` policy. Physics thread only."""

import logging
from collections.abc import Callable
from time import perf_counter
from typing import ParamSpec, Protocol, TypeVar

from mjplug.errors import PluginError, RequestError, is_fault
from mjplug.physics.loop import Loop
from mjplug.physics.scheduler import Timer
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.stopwatch import Stopwatch

P = ParamSpec("P")
M = TypeVar("M")


class Stepping(Protocol):
    """The part of a plugin that the loop calls."""

    def update(self) -> None:
        """Runs before every step while active."""

    def on_reset(self) -> None:
        """Runs after every reset."""


class PluginStepper:
    """The stepper of a plugin. `update` is the plugin's own method without a wrapper, because it runs at every step."""

    def __init__(
        self, update: Callable[[], None], on_reset: Callable[[], None], failed: Callable[[BaseException], None]
    ) -> None:
        self.update = update
        self.on_reset = on_reset
        self.failed = failed


class Guard:
    """Runs the callbacks of one plugin instance, measures their time, and disables the instance if one fails.

    Attributes:
        disabled: Why the instance was disabled; empty while it is enabled.
        holds: Velocity holds to release when the instance is disabled.
        timers: Timers of the instance that were not cancelled, by their number in the order of creation.

    Args:
        name: The instance's name.
        logger: Logs failures.
        loop: The physics loop.
        stopwatch: Measures the time that the instance takes.
        disable_on_error: Whether a failure disables the instance instead of stopping the server.
    """

    def __init__(
        self, name: str, logger: logging.Logger, loop: Loop, stopwatch: Stopwatch, disable_on_error: bool
    ) -> None:
        self.disabled = ""
        self.holds: list[VelocityHold] = []
        self.timers: dict[int, Timer] = {}
        self._timers_created = 0
        self._name = name
        self._logger = logger
        self._loop = loop
        self._stopwatch = stopwatch
        self._disable_on_error = disable_on_error
        self._stepper: PluginStepper | None = None

    def add_timer(self, timer: Timer) -> Timer:
        """Adds a timer of the instance; returns it."""
        self.timers = {number: other for number, other in self.timers.items() if not other.cancelled}
        self.timers[self._timers_created] = timer
        self._timers_created += 1
        return timer

    def begin_again(self) -> dict[int, Timer]:
        """Releases what the plugin has created, before it is started again; returns its timers, which continue.

        Waiting requests of the plugin are refused, because they belong to the previous model.
        """
        self._loop.scheduler.cancel("cancelled: the model has changed", owner=self)
        self.deactivate()
        for hold in self.holds:
            hold.release()
        self.holds.clear()
        timers, self.timers, self._timers_created = self.timers, {}, 0
        return timers

    def end_again(self, before: dict[int, Timer]) -> None:
        """Lets new timers continue in the phases of those before, and cancels the others."""
        for number, timer in self.timers.items():
            old = before.pop(number, None)
            if old is not None and old.period_steps == timer.period_steps and not timer.cancelled:
                self._loop.scheduler.adopt(timer, old)
            elif old is not None:
                old.cancel()
        for old in before.values():
            old.cancel()

    def disable(self, reason: str) -> None:
        """Disables the instance without stopping the server, because it does not fit the changed model."""
        self.disabled = reason
        self._logger.error("%s", reason)
        self.deactivate()
        for hold in self.holds:
            hold.release()
        self._loop.scheduler.cancel(reason, owner=self)

    @property
    def stepper(self) -> PluginStepper | None:
        """The stepper of the plugin; None before `attach`."""
        return self._stepper

    @property
    def active(self) -> bool:
        """Whether the plugin's `update` is called before every step."""
        return self._stepper in self._loop.steppers.active

    @property
    def name(self) -> str:
        """The instance's name."""
        return self._name

    def attach(self, plugin: Stepping) -> None:
        """Adds the plugin to the loop's steppers; it is inactive at first."""
        stepper = self._stepper = PluginStepper(plugin.update, self.guarded(plugin.on_reset), self.fail)
        self._stopwatch.watch(stepper)
        self._loop.steppers.add(stepper)

    def activate(self) -> None:
        """Starts the calls of the plugin's `update` before every step, unless the instance was disabled."""
        if self._stepper is not None and not self.disabled:
            self._loop.steppers.activate(self._stepper)

    def deactivate(self) -> None:
        """Stops the calls of the plugin's `update`."""
        if self._stepper is not None:
            self._loop.steppers.deactivate(self._stepper)

    def guarded(self, callback: Callable[P, None]) -> Callable[P, None]:
        """Returns a wrapper of a callback that measures its time and handles its exceptions.

        After the instance was disabled, the wrapper does nothing.
        """

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

    def report(self, what: str, error: BaseException) -> None:
        """Logs an exception of the plugin that neither disables it nor stops the server."""
        self._logger.error("plugin %s: %s", self._name, what, exc_info=error)

    def checked(self, callback: Callable[[M], None]) -> Callable[[M], None]:
        """Returns a wrapper like that of `guarded` for a client that waits for the outcome.

        The wrapper raises RequestError if the callback refuses the value or fails, and if the instance is disabled.
        """

        def call(value: M) -> None:
            if self.disabled:
                raise RequestError(self.disabled)
            began = perf_counter()
            try:
                callback(value)
            except RequestError:
                raise
            except BaseException as error:
                if not is_fault(error):
                    raise
                self.fail(error)
                raise RequestError(f"plugin {self._name} failed: {error!r}") from error
            finally:
                self._stopwatch.add(began)

        return call

    def fail(self, error: BaseException) -> None:
        """Disables the instance: refuses its requests and releases its holds. Stops the server if the policy says so.

        Args:
            error: The exception that the plugin raised.
        """
        name = self._name
        self._logger.error("plugin %s failed", name, exc_info=error)
        self.disabled = f"plugin {name} was disabled after an error: {error!r}"
        self.deactivate()
        for hold in self.holds:
            hold.release()
        self._loop.scheduler.cancel(self.disabled, owner=self)
        if not self._disable_on_error:
            self._loop.fail(PluginError(f"plugin {name} failed: {error!r} (on_plugin_error: stop)"))
