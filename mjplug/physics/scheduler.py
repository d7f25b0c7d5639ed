"""What happens at which step: timers, and requests that wait. Physics thread only."""

import heapq
import itertools
import logging
from collections.abc import Callable, Generator
from fractions import Fraction
from typing import Protocol

from mjplug.errors import RequestError, is_fault
from mjplug.throttle import FailureLog
from mjplug_schemas.message import Message

NEVER = 1 << 62
"""A step number that is never reached."""

MOST_REACHED_WAITS = 10_000
"""Waits in a row that were over when they were yielded, after which a request is ended: it would hold up the loop."""

_log = logging.getLogger(__name__)


class Event:
    """Something a waiting request can wait for, besides a step number."""

    def __init__(self) -> None:
        self._waiting: list[Callable[[], None]] = []
        self.is_set = False

    def set(self) -> None:
        """Lets everything that waits for the event go on; later waits do not block."""
        self.is_set = True
        waiting, self._waiting = self._waiting, []
        for resume in waiting:
            resume()

    def when_set(self, resume: Callable[[], None]) -> None:
        """Calls `resume` when the event is set, at once if it is already."""
        if self.is_set:
            resume()
        else:
            self._waiting.append(resume)


Wait = int | Event
"""What a slow service yields: the step number, or the event, at which it goes on; at once if that is past."""

Slow = Generator[Wait, None, Message]
"""A service handler that takes simulated time: yields waits, returns the response."""


class Answer(Protocol):
    """Where the outcome of a waiting request goes."""

    def respond(self, response: Message) -> None:
        """Takes the response."""

    def refuse(self, reason: str) -> None:
        """Takes the reason why there is none."""


class Request(Answer, Protocol):
    """A service request that a handler answers, at once or later."""

    @property
    def request(self) -> Message:
        """The decoded request."""


class Timer:
    """Calls back at a fixed rate of simulated time.

    Firing k comes at the first step boundary at or after k periods, so the phase error stays below one step and the
    mean rate is exact even where the period is no multiple of the time step.

    Attributes:
        callback: Called at each firing.
        wanted: Asked at each firing; if it returns False the timer sleeps, and costs nothing, until it is woken.
        due: The step of the next firing.
        asleep: Whether the timer sleeps.
        cancelled: Whether the timer was cancelled.
    """

    def __init__(
        self, period_steps: Fraction, callback: Callable[[], None], wanted: Callable[[], bool] | None, start: int
    ) -> None:
        self.callback = callback
        self.wanted = wanted
        self.asleep = False
        self.cancelled = False
        self._num, self._den = period_steps.numerator, period_steps.denominator
        self.rephase(start)

    def rephase(self, start: int) -> None:
        """Counts the periods from the boundary `start` on."""
        self._start = start
        self.due_after(start)

    def due_after(self, step: int) -> None:
        """Makes the first firing after `step` the next one, in the same phase."""
        periods = (step - self._start) * self._den // self._num + 1
        self.due = self._start - (-periods * self._num // self._den)

    def cancel(self) -> None:
        """Stops the timer for good."""
        self.cancelled = True


class WaitingCall:
    """A service call that waits in the scheduler for its next step or event.

    Attributes:
        owner: Who may close it before its time.
        done: Whether it has been answered.
    """

    def __init__(self, generator: Slow, answer: Answer, owner: object, failures: FailureLog) -> None:
        self.owner = owner
        self.done = False
        self._failures = failures
        self._generator = generator
        self._answer = answer

    def resume(self) -> Wait | None:
        """Runs to the next wait and returns it; None means that the request has been answered."""
        try:
            try:
                wait: object = next(self._generator)
                while not isinstance(wait, int | Event):
                    # Thrown in where it was yielded, so that the handler's own `finally` runs.
                    wait = self._generator.throw(
                        TypeError(f"a service yields step numbers (int) or events, not {wait!r}")
                    )
                return wait
            except StopIteration as stop:
                self._answer.respond(stop.value)
        except RequestError as error:
            self._answer.refuse(str(error))
        except BaseException as error:
            if not is_fault(error):
                raise
            self._failures.log("a service failed")
            self._answer.refuse(f"internal error: {error!r}")
        self.done = True
        return None

    def close(self, reason: str) -> None:
        """Ends the request early: its `finally` blocks run, its client hears the reason."""
        if self.done:
            return
        self.done = True
        try:
            self._generator.close()
        except BaseException as error:
            if not is_fault(error):
                raise
            self._failures.log("a service failed while it was closed")
        self._answer.refuse(reason)


class Scheduler:
    """Knows the next due step over all timers and waiting requests.

    Attributes:
        next_due: The earliest step at which something is due; NEVER if nothing is.
        failures: Where failures of services are logged.

    Args:
        now: Returns the number of steps taken so far.
    """

    def __init__(self, now: Callable[[], int]) -> None:
        self.next_due = NEVER
        self.failures = FailureLog(_log)
        self._now = now
        self._heap: list[tuple[int, int, Callable[[int], None]]] = []
        self._order = itertools.count()
        self._timers: dict[Timer, int] = {}
        self._calls: dict[WaitingCall, None] = {}

    @property
    def waiting(self) -> int:
        """How many requests wait."""
        return len(self._calls)

    def every(
        self,
        period_steps: Fraction,
        callback: Callable[[], None],
        start: int,
        wanted: Callable[[], bool] | None = None,
    ) -> Timer:
        """Starts a timer.

        Args:
            period_steps: The period in steps, positive, not necessarily whole; a period below one step fires at every
                step.
            callback: Called at each firing.
            start: The boundary from which the periods count.
            wanted: If it returns False when the timer fires, the timer sleeps until `wake`.
        """
        timer = Timer(max(period_steps, Fraction(1)), callback, wanted, start)
        order = next(self._order)
        self._timers[timer] = order
        self._push_timer(order, timer)
        return timer

    def wake(self, timer: Timer, step: int) -> None:
        """Lets a sleeping timer go on at `step`, in its old phase; a timer that does not sleep is left alone."""
        if timer.asleep and not timer.cancelled:
            timer.asleep = False
            timer.due_after(step)
            self._push_timer(self._timers[timer], timer)

    def start(self, generator: Slow, answer: Answer, owner: object = None) -> None:
        """Runs a slow service to its first wait and keeps it until it has answered."""
        call = WaitingCall(generator, answer, owner, self.failures)
        self._calls[call] = None
        self._resume(call)

    def run_due(self, step: int) -> None:
        """Calls everything that is due at the boundary after `step` steps, in order of due step, then of creation."""
        heap = self._heap
        while heap and heap[0][0] <= step:
            _, _, run = heapq.heappop(heap)
            run(step)
        self.next_due = heap[0][0] if heap else NEVER

    def cancel(self, reason: str, owner: object = None) -> None:
        """Ends every waiting request, or those of one owner, with `reason`."""
        for call in [call for call in self._calls if owner is None or call.owner is owner]:
            # One that was closed before may have let this one end.
            self._calls.pop(call, None)
            call.close(reason)

    def rephase(self, step: int) -> None:
        """Restarts the phase of every timer at `step`, and forgets everything else that was due."""
        self._heap.clear()
        self.next_due = NEVER
        for timer, order in self._timers.items():
            timer.asleep = False
            timer.rephase(step)
            self._push_timer(order, timer)

    def _push(self, due: int, order: int, run: Callable[[int], None]) -> None:
        heapq.heappush(self._heap, (due, order, run))
        self.next_due = self._heap[0][0]

    def _push_timer(self, order: int, timer: Timer) -> None:
        def fire(step: int) -> None:
            if timer.cancelled:
                del self._timers[timer]
            elif timer.wanted is not None and not timer.wanted():
                timer.asleep = True
            else:
                timer.due_after(timer.due)
                self._push(timer.due, order, fire)
                timer.callback()

        self._push(timer.due, order, fire)

    def _resume(self, call: WaitingCall) -> None:
        for _ in range(MOST_REACHED_WAITS):
            # It may have been closed since it began to wait.
            wait = None if call.done else call.resume()
            if wait is None:
                self._calls.pop(call, None)
                return
            if isinstance(wait, Event):
                if not wait.is_set:
                    wait.when_set(lambda: self._resume(call))
                    return
            elif wait > self._now():
                self._push(wait, next(self._order), lambda _: self._resume(call))
                return
        self._calls.pop(call, None)
        reason = f"it waited {MOST_REACHED_WAITS} times in a row for what was past; a step later is `host.step + 1`"
        self.failures.log(f"a service was ended: {reason}")
        call.close(f"internal error: {reason}")
