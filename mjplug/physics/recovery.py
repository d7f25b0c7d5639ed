"""The divergence policy, and the log lines about divergences."""

import logging
from dataclasses import dataclass
from typing import Literal

from mjplug.physics.divergence import Divergence
from mjplug.physics.simulation import Simulation

OnDivergence = Literal["pause", "reset", "stop"]

MIN_STEPS_BETWEEN_RESETS = 10
"""If the simulation diverges again within this many steps after an automatic reset, it is paused instead of reset."""

REPORT_INTERVAL = 1.0
"""Minimum wall time between two log lines about divergences with the same consequence [s]."""

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Lines:
    """Limits the log lines about one consequence.

    Attributes:
        next_line_at: Wall time before which no further line is logged [s].
        suppressed: Lines suppressed since the last one.
    """

    next_line_at: float = float("-inf")
    suppressed: int = 0

    @property
    def times(self) -> str:
        return "once" if self.suppressed == 1 else f"{self.suppressed} times"

    def logged(self, now: float) -> None:
        self.next_line_at, self.suppressed = now + REPORT_INTERVAL, 0


class Recovery:
    """Chooses the consequence of a divergence and logs it, at a limited rate.

    Attributes:
        count: Divergences since the start.
        last: Sentence about the latest divergence; empty if there was none.

    Args:
        policy: `sim.on_divergence`.
    """

    def __init__(self, policy: OnDivergence) -> None:
        self.count = 0
        self.last = ""
        self._policy = policy
        self._reset_at = -MIN_STEPS_BETWEEN_RESETS
        self._diverged_at: tuple[int, int] | None = None
        self._lines: dict[OnDivergence, _Lines] = {}

    def decide(self, divergence: Divergence, simulation: Simulation, now: float) -> OnDivergence:
        """Counts a divergence and returns its consequence.

        Args:
            divergence: The divergence.
            simulation: The simulation, in the state before the step that diverged.
            now: Wall time [s].
        """
        step = simulation.step
        self.count += 1
        self.last = f"the simulation diverged in step {step + 1} (t = {simulation.time_ns / 1e9:.6f} s): {divergence}"
        if self._policy == "reset" and step - self._reset_at >= MIN_STEPS_BETWEEN_RESETS:
            self._reset_at = step
            self._report("reset", now, f"{self.last}; the world is reset (sim.on_divergence: reset)")
            return "reset"
        self._diverged_at = step, simulation.epoch
        if self._policy == "stop":
            return "stop"
        why = (
            f"less than {MIN_STEPS_BETWEEN_RESETS} steps after a reset"
            if self._policy == "reset"
            else "sim.on_divergence: pause"
        )
        remedy = ("the state before that step is already invalid; reset the world",) if divergence.in_state else ()
        self._report("pause", now, f"{self.last}; paused before that step ({why})", *remedy)
        return "pause"

    def steps_since_reset(self, step: int) -> int:
        """Returns the number of steps since the last automatic reset, at most `MIN_STEPS_BETWEEN_RESETS`."""
        return min(step - self._reset_at, MIN_STEPS_BETWEEN_RESETS)

    def restore(self, step: int, steps_since_reset: int) -> None:
        """Sets what `steps_since_reset` returns at `step`, when a saved state is restored."""
        self._reset_at = step - steps_since_reset

    def before_diverged_step(self, simulation: Simulation) -> bool:
        """Returns whether the next step is the one that diverged last."""
        return self._diverged_at == (simulation.step, simulation.epoch)

    def report_suppressed(self, now: float, final: bool = False) -> None:
        """Logs how many divergences were not logged, at most once in `REPORT_INTERVAL`.

        Args:
            now: Wall time [s].
            final: Whether this is the last call, so that they are logged without waiting for the interval.
        """
        for consequence, lines in self._lines.items():
            if lines.suppressed and (final or now >= lines.next_line_at):
                _log.error(
                    "the simulation diverged %s more (consequence: %s); latest: %s", lines.times, consequence, self.last
                )
                lines.logged(now)

    def _report(self, consequence: OnDivergence, now: float, *sentences: str) -> None:
        lines = self._lines.setdefault(consequence, _Lines())
        if now < lines.next_line_at:
            lines.suppressed += 1
            return
        first, *others = sentences
        _log.error("%s%s", first, f"; it diverged {lines.times} more since the last line" if lines.suppressed else "")
        for sentence in others:
            _log.error("%s", sentence)
        lines.logged(now)
