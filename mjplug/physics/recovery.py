"""What follows a divergence: the policy, how often it happened, and what the log gets of it."""

import logging
from dataclasses import dataclass
from typing import Literal

from mjplug.physics.divergence import Divergence
from mjplug.physics.simulation import Simulation

OnDivergence = Literal["pause", "reset", "stop"]

STEPS_TO_RECOVER = 10
"""A world that diverges again within so many steps after a reset would be reset for ever; it is paused instead."""

REPORT_SECONDS = 1.0
"""Wall time between two log lines about divergences that had the same consequence [s]."""

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Lines:
    """The log lines about one consequence: from when on there may be another, and how many were held back."""

    quiet_until: float = float("-inf")
    held: int = 0

    @property
    def times(self) -> str:
        return "once" if self.held == 1 else f"{self.held} times"

    def told(self, now: float) -> None:
        self.quiet_until, self.held = now + REPORT_SECONDS, 0


class Recovery:
    """Decides what follows a divergence, and tells the log, which a world that diverges all the time must not fill.

    Attributes:
        count: Divergences since the start.
        last: What the latest one was, and when; empty if there was none.

    Args:
        policy: `sim.on_divergence`.
    """

    def __init__(self, policy: OnDivergence) -> None:
        self.count = 0
        self.last = ""
        self._policy = policy
        self._reset_at = -STEPS_TO_RECOVER
        self._stuck_at: tuple[int, int] | None = None
        self._lines: dict[OnDivergence, _Lines] = {}

    def decide(self, divergence: Divergence, simulation: Simulation, now: float) -> OnDivergence:
        """Counts a divergence and returns what is to be done about it.

        Args:
            divergence: What diverged.
            simulation: In the state before the step that went wrong.
            now: Wall time [s].
        """
        step = simulation.step
        self.count += 1
        self.last = f"the simulation diverged in step {step + 1} (t = {simulation.time_ns / 1e9:.6f} s): {divergence}"
        if self._policy == "reset" and step - self._reset_at >= STEPS_TO_RECOVER:
            self._reset_at = step
            self._say("reset", now, f"{self.last}; the world is reset (sim.on_divergence: reset)")
            return "reset"
        self._stuck_at = step, simulation.epoch
        if self._policy == "stop":
            return "stop"
        why = "again so soon after a reset" if self._policy == "reset" else "sim.on_divergence: pause"
        repair = ("the state before that step is bad already: reset the world",) if divergence.in_state else ()
        self._say("pause", now, f"{self.last}; paused before that step ({why})", *repair)
        return "pause"

    def stuck(self, simulation: Simulation) -> bool:
        """Returns whether the world still stands right before a step that diverged."""
        return self._stuck_at == (simulation.step, simulation.epoch)

    def report_held(self, now: float, at_the_end: bool = False) -> None:
        """Logs how many lines were held back, unless there was one a moment ago.

        Args:
            now: Wall time [s].
            at_the_end: Whether there may be no later, so that it is said now.
        """
        for consequence, lines in self._lines.items():
            if lines.held and (at_the_end or now >= lines.quiet_until):
                _log.error("diverged %s more (followed by: %s); the latest: %s", lines.times, consequence, self.last)
                lines.told(now)

    def _say(self, consequence: OnDivergence, now: float, *sentences: str) -> None:
        lines = self._lines.setdefault(consequence, _Lines())
        if now < lines.quiet_until:
            lines.held += 1
            return
        first, *others = sentences
        _log.error("%s%s", first, f"; it diverged {lines.times} more since the line before" if lines.held else "")
        for sentence in others:
            _log.error("%s", sentence)
        lines.told(now)
