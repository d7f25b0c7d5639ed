"""Steps that `step_simulation` requests while the simulation is paused. Physics thread only."""

from collections import deque

from mjplug.physics.scheduler import Event


class StepGoal:
    """The steps of one request.

    Attributes:
        start: The step number from which the steps count.
        target: The step number to reach.
        ended: Set when the goal is reached or cancelled.
        failure: Why the goal was cancelled; empty if it was not.
    """

    def __init__(self, start: int, target: int) -> None:
        self.start = start
        self.target = target
        self.ended = Event()
        self.failure = ""

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
        """Target of the first goal; there must be at least one."""
        return self._goals[0].target

    def add(self, step: int, steps: int) -> StepGoal:
        """Adds a goal of `steps` steps that starts after the last goal, or at `step` if there is none; returns it."""
        start = self._goals[-1].target if self._goals else step
        goal = StepGoal(start, start + steps)
        self._goals.append(goal)
        return goal

    def end_reached(self, step: int) -> None:
        """Ends every goal whose target is at most `step`."""
        while self._goals and self._goals[0].target <= step:
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
