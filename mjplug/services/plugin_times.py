"""The status `plugins`: the time that each plugin instance takes on the physics thread."""

from mjplug.contracts.diagnostics import Diagnosis
from mjplug.physics.loop import Loop
from mjplug.plugin.stopwatch import SAMPLES_PER_PERIOD, Stopwatch


class PluginTimes:
    """Reports on the period between the last two calls of `refresh`.

    Args:
        loop: The loop that calls the plugins.
        now: Wall time [s].
    """

    def __init__(self, loop: Loop, now: float) -> None:
        self._loop = loop
        self._at = now
        self._step = loop.simulation.step
        self._watches: dict[str, Stopwatch] = {}
        self._values: dict[str, object] = {}
        self._total = 0.0

    def add(self, name: str) -> Stopwatch:
        """Returns the stopwatch of a plugin instance; creates it if there is none."""
        return self._watches.setdefault(name, Stopwatch())

    def refresh(self, now: float) -> None:
        """Ends the current period, which `diagnose` then reports on, and starts the next one.

        Args:
            now: Wall time [s].
        """
        seconds, steps = now - self._at, self._loop.simulation.step - self._step
        self._at, self._step = now, self._loop.simulation.step
        self._values, self._total = {}, 0.0
        for name, watch in self._watches.items():
            measured = watch.measured
            update, busy, calls = watch.update_time(), watch.seconds, watch.calls
            watch.seconds, watch.calls = 0.0, 0
            if update is not None:
                # If not every update was measured, this is an upper estimate: the plugin may have been active in only
                # some of these steps.
                busy += update * (steps if measured == SAMPLES_PER_PERIOD else measured)
            if seconds <= 0 or not busy:
                continue
            self._total += busy / seconds
            self._values[f"{name} (%)"] = 100.0 * busy / seconds
            self._values[f"{name} calls (Hz)"] = calls / seconds
            if update is not None:
                self._values[f"{name} update (us)"] = 1e6 * update

    def diagnose(self) -> Diagnosis:
        """Returns the CPU share of each plugin instance in the last period."""
        return Diagnosis(message=f"{100.0 * self._total:.3g} % of the time", values=self._values)
