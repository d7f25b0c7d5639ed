"""Steps that clients ask for while the simulation is paused. Physics thread only."""

from collections import deque

from mjplug.physics.scheduler import Event


class StepGoal:
    """Steps that somebody waits for.

    Attributes:
        start: The step number from which they count.
        target: The step number to reach.
        ended: Set when it is reached or given up.
        failure: Why it was given up; empty if it was not.
    """

    def __init__(self, start: int, target: int) -> None:
        self.start = start
        self.target = target
        self.ended = Event()
        self.failure = ""

    def end(self, failure: str = "") -> None:
        """Marks the goal as reached, or as given up with a reason."""
        self.failure = failure
        self.ended.set()


class StepGoals:
    """The goals under way, each behind the one before."""

    def __init__(self) -> None:
        self._goals: deque[StepGoal] = deque()

    def __bool__(self) -> bool:
        return bool(self._goals)

    @property
    def next_target(self) -> int:
        """The step number of the first goal; there must be one."""
        return self._goals[0].target

    def add(self, step: int, steps: int) -> StepGoal:
        """Adds a goal of `steps` more steps, behind those there are, or else from `step` on."""
        start = self._goals[-1].target if self._goals else step
        goal = StepGoal(start, start + steps)
        self._goals.append(goal)
        return goal

    def end_reached(self, step: int) -> None:
        """Ends the goals that `step` reaches."""
        while self._goals and self._goals[0].target <= step:
            self._goals.popleft().end()

    def withdraw(self, goal: StepGoal) -> None:
        """Forgets a goal that nobody waits for any more; those behind it keep their targets."""
        if goal in self._goals:
            self._goals.remove(goal)

    def give_up(self, reason: str) -> None:
        """Ends every goal with a reason."""
        goals, self._goals = self._goals, deque()
        for goal in goals:
            goal.end(reason)
