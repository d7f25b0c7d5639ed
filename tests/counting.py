"""An action for tests: it counts one number per step, and publishes each."""

from pydantic import Field

from mjplug.plugin import GoalCanceled, RequestError
from mjplug_schemas.action import Action
from mjplug_schemas.idl import int64, string
from mjplug_schemas.message import Message


class Count(Action, package="probe"):
    """Counts to a number, one per step."""

    class Goal(Message):
        """How far."""

        number: int64 = Field(0, description="The last number.")

    class Result(Message):
        """How far it came."""

        reached: int64 = Field(0, description="The last number that was reached.")
        error_string: string = Field("", description="Why it did not reach its number.")

    class Feedback(Message):
        """One number."""

        number: int64 = Field(0, description="The number.")


class Counter:
    """Handlers of goals, and what happened to them."""

    def __init__(self, host):
        self.host = host
        self.ended = []

    def count(self, request, goal):
        """Counts; leaves the outcome of a cancelled goal to the server."""
        if request.number < 0:
            raise RequestError(f"number is {request.number}; it must not be negative")
        try:
            for number in range(1, request.number + 1):
                goal.feedback(Count.Feedback(number=number))
                yield self.host.step + 1
            return Count.Result(reached=request.number)
        finally:
            self.ended.append(goal.id)

    def count_and_report(self, request, goal):
        """Counts; tells a client that cancels how far it came, two steps later."""
        number = 0
        try:
            while number < request.number:
                yield self.host.step + 1
                number += 1
        except GoalCanceled:
            yield self.host.step + 2
            return Count.Result(reached=number, error_string="cancelled")
        return Count.Result(reached=number)
