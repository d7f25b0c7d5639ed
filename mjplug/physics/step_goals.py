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
        in_parts: Whether there are several parts.
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
        self.in_parts = parts > 1
        self._steps = steps
        self._between = between
        self.ended = Event()
        self.failure = ""

    def begin_next_part(self) -> bool:
        """Begins the next part; returns False if the present part is the last one."""
        if self.target >= self.last:
            return False
        if self._between is not None:
            self._between()
        self.target += self._steps
        return True

    def begin_earlier(self, steps: int) -> None:
        """Moves a goal that has not begun by a number of steps."""
        self.start -= steps
        self.target -= steps
        self.last -= steps

    def end(self, failure: str = "") -> None:
        """Ends the goal as reached, or as cancelled if a reason is given."""
        self.failure = failure
        self.ended.set()


class StepGoals:
    """A queue of goals: each one starts where the previous one ends.

    Attributes:
        first: The goal whose steps are taken now; None if there is none.

    Args:
        now: Returns the number of steps taken so far.
    """

    def __init__(self, now: Callable[[], int]) -> None:
        self.first: StepGoal | None = None
        self._now = now
        self._later: deque[StepGoal] = deque()

    def __bool__(self) -> bool:
        return self.first is not None

    def add(self, step: int, steps: int, parts: int = 1, between: Callable[[], None] | None = None) -> StepGoal:
        """Adds a goal that starts after the last goal, or at `step` if there is none; returns it.

        Args:
            step: Number of steps taken so far.
            steps: Number of steps of each part.
            parts: Number of parts.
            between: Called after each part but the last, before the next one begins.
        """
        if self.first is None:
            goal = self.first = StepGoal(step, steps, parts, between)
        else:
            goal = StepGoal((self._later or (self.first,))[-1].last, steps, parts, between)
            self._later.append(goal)
        return goal

    def end_reached(self, step: int) -> None:
        """Ends every goal whose last part ends at `step` or before."""
        while (goal := self.first) is not None and goal.last <= step:
            self._drop_first()
            goal.end()

    def remove(self, goal: StepGoal) -> None:
        """Removes a goal whose request has ended early; later goals do not take its remaining steps."""
        if goal is self.first:
            self._drop_first()
            begin, later = max(self._now(), goal.start), (self.first, *self._later) if self.first is not None else ()
        elif goal in self._later:
            place = self._later.index(goal)
            del self._later[place]
            begin, later = goal.start, tuple(self._later)[place:]
        else:
            return
        for other in later:
            other.begin_earlier(goal.last - begin)

    def cancel(self, reason: str) -> None:
        """Cancels every goal with a reason."""
        goals = () if self.first is None else (self.first, *self._later)
        self.first = None
        self._later.clear()
        for goal in goals:
            goal.end(reason)

    def _drop_first(self) -> None:
        self.first = self._later.popleft() if self._later else None
