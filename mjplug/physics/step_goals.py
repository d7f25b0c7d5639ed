"""Steps that `step_simulation` and `step` request while the simulation is paused. Physics thread only."""

from collections import deque
from collections.abc import Callable

from mjplug.physics.scheduler import Event


class StepGoal:
    """The steps of one request, in one part or in several parts of equal length.

    Attributes:
        start: The step number from which the steps count.
        target: The step number at which the present part ends.
        last: The step number at which the last part ends.
        ended: Set when the last part has ended, or the goal is cancelled.
        failure: Why the goal was cancelled; empty if it was not.

    Args:
        start: As above.
        steps: Number of steps of each part, at least 1.
        parts: Number of parts, at least 1.
        between: Called after each part but the last, before the next one begins.
    """

    def __init__(self, start: int, steps: int, parts: int = 1, between: Callable[[], None] | None = None) -> None:
        self.start = start
        self.target = start + steps
        self.last = start + steps * parts
        self._steps = steps
        self._between = between
        self.ended = Event()
        self.failure = ""

    @property
    def in_parts(self) -> bool:
        """Whether there are several parts."""
        return self.last - self.start > self._steps

    def begin_next_part(self) -> bool:
        """Begins the next part; returns False if the present part is the last one."""
        if self.target >= self.last:
            return False
        if self._between is not None:
            self._between()
        self.target += self._steps
        return True

    def end(self, failure: str = "") -> None:
        """Ends the goal as reached, or as cancelled if a reason is given."""
        self.failure = failure
        self.ended.set()


class StepGoals:
    """A queue of goals: each one starts where the previous one ends."""

    def __init__(self) -> None:
        self._goals: deque[StepGoal] = deque()

    def __bool__(self) -> bool:
        return bool(self._goals)

    @property
    def next_target(self) -> int:
        """Target of the present part of the first goal; there must be at least one goal."""
        return self._goals[0].target

    @property
    def in_parts(self) -> bool:
        """Whether the first goal has several parts; false without goals."""
        return bool(self._goals) and self._goals[0].in_parts

    def add(self, step: int, steps: int, parts: int = 1, between: Callable[[], None] | None = None) -> StepGoal:
        """Adds a goal that starts after the last goal, or at `step` if there is none; returns it.

        Args:
            step: Number of steps taken so far.
            steps: Number of steps of each part.
            parts: Number of parts.
            between: Called after each part but the last, before the next one begins.
        """
        start = self._goals[-1].last if self._goals else step
        goal = StepGoal(start, steps, parts, between)
        self._goals.append(goal)
        return goal

    def begin_next_part(self) -> bool:
        """Begins the next part of the first goal; returns False if its present part is the last one."""
        return self._goals[0].begin_next_part()

    def end_reached(self, step: int) -> None:
        """Ends every goal whose last part ends at `step` or before."""
        while self._goals and self._goals[0].last <= step:
            self._goals.popleft().end()

    def remove(self, goal: StepGoal) -> None:
        """Removes a goal whose request has ended; later goals keep their targets."""
        if goal in self._goals:
            self._goals.remove(goal)

    def cancel(self, reason: str) -> None:
        """Cancels every goal with a reason."""
        goals, self._goals = self._goals, deque()
        for goal in goals:
            goal.end(reason)
