"""Schedules timers and waiting requests by step number. Physics thread only."""

import heapq
import itertools
import logging
from collections.abc import Callable, Generator, Mapping
from fractions import Fraction
from typing import Any, Protocol

from mjplug.errors import RequestError, is_fault
from mjplug.throttle import FailureLog
from mjplug_schemas.message import Message

NEVER = 1 << 62
"""A step number that is never reached."""

MAX_PAST_WAITS = 10_000
"""Maximum number of waits in a row that are over when they are yielded; then the request is ended, because it would
block the loop."""

_log = logging.getLogger(__name__)


class Event:
    """An event that a service handler can wait for, instead of a step number.

    Attributes:
        is_set: Whether the event is set.
    """

    def __init__(self) -> None:
        self._waiting: list[Callable[[], None]] = []
        self.is_set = False

    def set(self) -> None:
        """Sets the event and resumes everything that waits for it; later waits do not block."""
        self.is_set = True
        waiting, self._waiting = self._waiting, []
        for resume in waiting:
            resume()

    def when_set(self, resume: Callable[[], None]) -> None:
        """Calls `resume` when the event is set; at once if it already is."""
        if self.is_set:
            resume()
        else:
            self._waiting.append(resume)


Wait = int | Event
"""What a slow service yields: the step number or the event at which it resumes; at once if that is past."""

Slow = Generator[Wait, None, Message]
"""A service handler that takes simulated time. It yields waits and returns the response."""

Running = Generator[Wait, None, Any]
"""The generator of a service or of a goal of an action."""


class Answer(Protocol):
    """Receives the outcome of a waiting request."""

    def respond(self, response: Any) -> None:
        """Sends the response."""

    def refuse(self, reason: str) -> None:
        """Sends the reason why the request failed."""


class Request(Answer, Protocol):
    """A service request that a handler answers, at once or later."""

    @property
    def request(self) -> Message:
        """The decoded request."""


class Timer:
    """Calls a function at a fixed rate of simulated time.

    Firing k is at the first step boundary at or after k periods. The phase error stays below one step, and the mean
    rate is exact even if the period is not a multiple of the time step.

    Attributes:
        callback: Called at each firing.
        while_true: Called before each firing; if it returns False, the timer sleeps until `Scheduler.wake`, at no cost.
        due: Step number of the next firing.
        asleep: Whether the timer sleeps.
        cancelled: Whether the timer was cancelled.
        period_steps: The period in steps, at least 1.
        start: The step number from which the periods count.

    Args:
        period_steps: The period in steps, at least 1.
        callback: Called at each firing.
        while_true: See the attribute; None means always.
        start: The step number from which the periods count.
    """

    def __init__(
        self, period_steps: Fraction, callback: Callable[[], None], while_true: Callable[[], bool] | None, start: int
    ) -> None:
        self.callback = callback
        self.while_true = while_true
        self.asleep = False
        self.cancelled = False
        self.period_steps = period_steps
        self._num, self._den = period_steps.numerator, period_steps.denominator
        self.start = start
        self.due_after(start)

    def due_after(self, step: int) -> None:
        """Sets `due` to the first firing after `step`, in the same phase."""
        periods = (step - self.start) * self._den // self._num + 1
        self.due = self.start - (-periods * self._num // self._den)

    def is_due(self, step: int) -> bool:
        """Returns whether the timer has a firing at `step` that has not happened yet."""
        return self.due <= step and not self.asleep

    def resume(self, start: int, due_now: bool, step: int) -> None:
        """Continues an earlier phase.

        Args:
            start: The step number from which the periods count.
            due_now: Whether a firing at `step` has not happened yet.
            step: The present step number.
        """
        self.start, self.asleep = start, False
        self.due_after(step - due_now)

    def cancel(self) -> None:
        """Stops the timer permanently."""
        self.cancelled = True


class Alarm:
    """Calls a function once at a step number, before the updates of that step; `set` it again for the next call.

    Neither a reset nor a restored state changes it; its owner sets or stops it then.

    Attributes:
        callback: The function.
        due: The step number; `NEVER` while the alarm is off.
        fire: Calls the function if the alarm is due at the given step.

    Args:
        callback: The function.
        changed: Called when `due` was set.
    """

    def __init__(self, callback: Callable[[], None], changed: Callable[["Alarm"], None]) -> None:
        self.callback = callback
        self.due = NEVER
        self.fire = self._fire
        self._changed = changed

    def set(self, step: int) -> None:
        """Calls the function at `step`, or soon if it is past, instead of at the step that was set before."""
        if step != self.due:
            self.due = step
            self._changed(self)

    def stop(self) -> None:
        """Turns the alarm off."""
        self.due = NEVER

    def _fire(self, step: int) -> None:
        # It may have been set to a later step since it was scheduled for this one.
        if self.due <= step:
            self.due = NEVER
            self.callback()


class WaitingCall:
    """A service call that waits in the scheduler for a step or an event.

    Attributes:
        owner: Key for `Scheduler.cancel`.
        done: Whether the request has been answered.
        running: Whether the handler runs now, further up in the call stack.
        waits: Number of waits so far; a wake-up from an earlier wait is ignored.

    Args:
        generator: The service handler's generator.
        answer: Receives the response or the refusal.
        owner: Key for `Scheduler.cancel`.
        failures: Logs exceptions of the handler.
    """

    def __init__(self, generator: Running, answer: Answer, owner: object, failures: FailureLog) -> None:
        self.owner = owner
        self.done = False
        self.running = False
        self.waits = 0
        self._failures = failures
        self._generator = generator
        self._answer = answer

    def resume(self, raised: Exception | None = None) -> Wait | None:
        """Runs the handler to its next wait and returns the wait; None if the request has been answered.

        Args:
            raised: Raised in the handler, where it waits.
        """
        self.running = True
        self.waits += 1
        try:
            try:
                wait: object = next(self._generator) if raised is None else self._generator.throw(raised)
                while not isinstance(wait, int | Event):
                    # Raised inside the handler, so that its `finally` blocks run.
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
        finally:
            self.running = False
        self.done = True
        return None

    def close(self, reason: str) -> None:
        """Ends the request early: runs the handler's `finally` blocks and refuses the request with `reason`."""
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
    """Runs timers and waiting requests when their step is reached.

    Attributes:
        next_due: The earliest step at which something is due; NEVER if nothing is.
        failures: Logs exceptions of service handlers.

    Args:
        now: Returns the number of steps taken so far.
    """

    def __init__(self, now: Callable[[], int]) -> None:
        self.next_due = NEVER
        self.failures = FailureLog(_log)
        self._now = now
        # Due step, order of creation, a unique number, and what to call.
        self._heap: list[tuple[int, int, int, Callable[[int], None]]] = []
        self._entries = itertools.count()
        self._order = itertools.count()
        self._timers: dict[Timer, int] = {}
        self._alarms: dict[Alarm, int] = {}
        self._calls: dict[WaitingCall, None] = {}

    @property
    def waiting(self) -> int:
        """Number of waiting requests."""
        return len(self._calls)

    def every(
        self,
        period_steps: Fraction,
        callback: Callable[[], None],
        start: int,
        while_true: Callable[[], bool] | None = None,
    ) -> Timer:
        """Starts a timer and returns it.

        Args:
            period_steps: The period in steps, positive, not necessarily whole; a period below one step fires at every
                step.
            callback: Called at each firing.
            start: The step number from which the periods count.
            while_true: Called before each firing; if it returns False, the timer sleeps until `wake`. None means
                always.
        """
        timer = Timer(max(period_steps, Fraction(1)), callback, while_true, start)
        order = next(self._order)
        self._timers[timer] = order
        self._push_timer(order, timer)
        return timer

    def adopt(self, timer: Timer, old: Timer) -> None:
        """Lets a new timer continue in place of an old one of the same period, which is cancelled."""
        old.cancel()
        timer.start, timer.due, timer.asleep = old.start, old.due, False
        order = self._timers[timer] = self._timers.pop(old, self._timers[timer])
        self._push_timer(order, timer)

    def remove(self, alarm: Alarm) -> None:
        """Removes an alarm for good."""
        alarm.stop()
        self._alarms.pop(alarm, None)

    def alarm(self, callback: Callable[[], None]) -> Alarm:
        """Returns a new alarm, which is off."""
        alarm = Alarm(callback, self._push_alarm)
        self._alarms[alarm] = next(self._order)
        return alarm

    def wake(self, timer: Timer, step: int) -> None:
        """Resumes a sleeping timer after `step`, in its old phase; does nothing if the timer does not sleep."""
        if timer.asleep and not timer.cancelled:
            timer.asleep = False
            timer.due_after(step)
            self._push_timer(self._timers[timer], timer)

    def start(self, generator: Running, answer: Answer, owner: object = None) -> WaitingCall:
        """Runs a slow service to its first wait, and resumes it at each wait until it has answered."""
        call = WaitingCall(generator, answer, owner, self.failures)
        self._calls[call] = None
        self._resume(call, 0)
        return call

    def interrupt(self, call: WaitingCall, error: Exception) -> None:
        """Raises an exception in a handler, where it waits. If it runs or has ended, nothing happens."""
        if not (call.done or call.running):
            self._resume(call, call.waits, error)

    def run_due(self, step: int) -> None:
        """Runs everything that is due after `step` steps, ordered by due step, then by creation."""
        heap = self._heap
        while heap and heap[0][0] <= step:
            _, _, _, run = heapq.heappop(heap)
            run(step)
        self.next_due = heap[0][0] if heap else NEVER

    def cancel(self, reason: str, owner: object = None) -> None:
        """Refuses every waiting request with `reason`; if `owner` is given, only the requests of that owner.

        A request whose handler calls this is not refused.
        """
        for call in [call for call in self._calls if (owner is None or call.owner is owner) and not call.running]:
            # Closing an earlier call may have ended this one.
            self._calls.pop(call, None)
            call.close(reason)

    def rephase(self, step: int) -> None:
        """Restarts the phase of every timer at `step`, and removes waiting requests that were due; alarms stay."""
        self.restore(step, {})

    def restore(self, step: int, phases: Mapping[Timer, tuple[int, bool]]) -> None:
        """Continues earlier phases of timers at `step`, and removes waiting requests that were due; alarms stay.

        Args:
            step: The present step number.
            phases: For each timer that continues, the step number from which its periods count, and whether a firing at
                `step` has not happened yet. The other timers start a new period.
        """
        self._heap.clear()
        self.next_due = NEVER
        for timer, order in self._timers.items():
            timer.resume(*phases.get(timer, (step, False)), step)
            self._push_timer(order, timer)
        for alarm in self._alarms:
            self._push_alarm(alarm)

    def _push(self, due: int, order: int, run: Callable[[int], None]) -> None:
        heapq.heappush(self._heap, (due, order, next(self._entries), run))
        self.next_due = self._heap[0][0]

    def _push_timer(self, order: int, timer: Timer) -> None:
        def fire(step: int) -> None:
            if timer.cancelled:
                self._timers.pop(timer, None)
            elif step < timer.due:
                # The timer has adopted a later phase since it was scheduled for this step.
                return
            elif timer.while_true is not None and not timer.while_true():
                timer.asleep = True
            else:
                timer.due_after(timer.due)
                self._push(timer.due, order, fire)
                timer.callback()

        self._push(timer.due, order, fire)

    def _push_alarm(self, alarm: Alarm) -> None:
        if alarm.due == NEVER:
            return
        self._push(alarm.due, self._alarms[alarm], alarm.fire)

    def _wake_up(self, call: WaitingCall) -> Callable[..., None]:
        """Returns the function that ends the present wait of a handler; its argument is ignored."""
        waits = call.waits
        return lambda *_: self._resume(call, waits)

    def _resume(self, call: WaitingCall, waits: int, error: Exception | None = None) -> None:
        """Runs a handler until it has to wait.

        Args:
            call: The call.
            waits: The number of the wait that is over.
            error: Raised in the handler.
        """
        if waits != call.waits:
            # An exception has ended that wait.
            return
        for _ in range(MAX_PAST_WAITS):
            # The call may have been closed while it waited.
            wait = None if call.done else call.resume(error)
            error = None
            if wait is None:
                self._calls.pop(call, None)
                return
            if isinstance(wait, Event):
                if not wait.is_set:
                    wait.when_set(self._wake_up(call))
                    return
            elif wait > self._now():
                self._push(wait, next(self._order), self._wake_up(call))
                return
        self._calls.pop(call, None)
        reason = (
            f"the service yielded {MAX_PAST_WAITS} steps or events in a row that were already past; "
            "yield `host.step + 1` to wait for the next step"
        )
        self.failures.log(f"a service was ended: {reason}")
        call.close(f"internal error: {reason}")
