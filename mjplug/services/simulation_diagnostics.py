"""The status `simulation`: speed, load, resets and divergences of the physics loop."""

from dataclasses import dataclass

from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.physics.loop import Loop
from mjplug.physics.timing import Timing, percentiles


@dataclass(frozen=True, slots=True)
class _Counts:
    """The loop's counters at one wall time.

    Attributes:
        at: The wall time [s].
        step: Steps taken.
        divergences: Divergences.
        drops: How often lag was dropped.
    """

    at: float
    step: int
    divergences: int
    drops: int

    @staticmethod
    def of(loop: Loop, now: float) -> "_Counts":
        return _Counts(now, loop.simulation.step, loop.recovery.count, loop.pacer.drops)


class SimulationDiagnostics:
    """Reports on the period between the last two calls of `refresh`.

    Args:
        loop: The loop to report on.
        now: Wall time [s].
    """

    def __init__(self, loop: Loop, now: float) -> None:
        self._loop = loop
        self._from = self._to = _Counts.of(loop, now)
        self._timing = Timing()

    def refresh(self, now: float) -> None:
        """Ends the current period, which `diagnose` then reports on, and starts the next one.

        Args:
            now: Wall time [s].
        """
        self._from, self._to = self._to, _Counts.of(self._loop, now)
        self._timing = self._loop.timing.take()

    def diagnose(self) -> Diagnosis:
        """Returns the status of the last period."""
        loop, timing = self._loop, self._timing
        # The step number goes back when an earlier state is restored.
        seconds, steps = self._to.at - self._from.at, max(0, self._to.step - self._from.step)
        rate = steps / seconds if seconds > 0 else 0.0
        factor = rate * float(loop.simulation.time.timestep)
        level, message = self._verdict(factor)
        median, slow = percentiles(timing.step_times, 50.0, 99.0)
        (late,) = percentiles(timing.lateness, 99.0)
        values: dict[str, object] = {
            "state": "paused" if loop.paused else "running",
            "wanted speed": loop.pacer.speed,
            "real-time factor": factor,
            "simulated time (s)": f"{loop.simulation.time_ns / 1e9:.6f}",
            "steps": loop.simulation.step,
            "step rate (Hz)": rate,
            "load (%)": 100.0 * timing.busy / seconds if seconds > 0 else 0.0,
            "step time mean (us)": 1e6 * timing.busy / steps if steps else 0.0,
            "step time p50 (us)": 1e6 * median,
            "step time p99 (us)": 1e6 * slow,
            "step lateness p99 (us)": 1e6 * late,
            "times fallen behind": loop.pacer.drops,
            "wall time lost (s)": loop.pacer.dropped,
            "contacts": int(loop.simulation.data.ncon),
            "resets": loop.simulation.epoch,
            "divergences": loop.recovery.count,
            "last divergence": loop.recovery.last,
            "waiting requests": loop.scheduler.waiting,
        }
        return Diagnosis(level, message, values)

    def _verdict(self, factor: float) -> tuple[Level, str]:
        loop = self._loop
        divergences, drops = self._to.divergences - self._from.divergences, self._to.drops - self._from.drops
        if loop.recovery.before_diverged_step(loop.simulation):
            return Level.ERROR, loop.recovery.last
        if divergences:
            return Level.WARN, f"{loop.recovery.last}; {divergences} in the last second"
        if drops:
            return Level.WARN, f"physics cannot keep up: {factor:.3g} x real time, sim.speed is {loop.pacer.speed}"
        return Level.OK, "paused" if loop.paused else f"running at {factor:.3g} x real time"
