"""Actions between the server and its transport. An action consists of three services and two topics, as in ROS 2.

In addition, a Zenoh client may send a goal with one query on the action's own name; see `GoalQuery`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from mjplug.contracts.transport import DEFAULT, LATCHED, Call, Publisher, ServiceName, Topic, Transport
from mjplug_schemas.action import Action
from mjplug_schemas.action_msgs import CancelGoal, GoalStatusArray
from mjplug_schemas.message import Message


@dataclass(frozen=True, slots=True)
class ActionName:
    """An action: its full ROS name (such as `/a/b`) and its type."""

    name: str
    type: type[Action]

    @property
    def send_goal(self) -> ServiceName:
        """The service that sends a goal."""
        return ServiceName(f"{self.name}/_action/send_goal", self.type.SendGoal)

    @property
    def cancel_goal(self) -> ServiceName:
        """The service that cancels goals."""
        return ServiceName(f"{self.name}/_action/cancel_goal", CancelGoal)

    @property
    def get_result(self) -> ServiceName:
        """The service that responds when a goal has ended."""
        return ServiceName(f"{self.name}/_action/get_result", self.type.GetResult)

    @property
    def feedback(self) -> Topic[Any]:
        """The topic with the feedback of all goals."""
        return Topic(f"{self.name}/_action/feedback", self.type.FeedbackMessage, DEFAULT)

    @property
    def status(self) -> Topic[GoalStatusArray]:
        """The topic with the states of all goals."""
        return Topic(f"{self.name}/_action/status", GoalStatusArray, LATCHED)

    @property
    def services(self) -> tuple[ServiceName, ServiceName, ServiceName]:
        """The three services."""
        return self.send_goal, self.cancel_goal, self.get_result

    @property
    def topics(self) -> tuple[Topic[Any], Topic[GoalStatusArray]]:
        """The two topics, which the server publishes."""
        return self.feedback, self.status


class GoalQuery(Protocol):
    """A goal that was sent with one query on the action's own name. It gets several replies. Physics thread."""

    @property
    def request(self) -> Message:
        """The decoded goal."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """The parameters of the Zenoh selector."""

    @property
    def form(self) -> Literal["cdr", "json"]:
        """The form in which the replies are sent."""

    def accept(self, response: Message, goal_id: bytes) -> None:
        """Sends the first reply: the response of the service `send_goal`, and the identifier of the goal."""

    def feedback(self, message: Message) -> None:
        """Sends feedback, a `FeedbackMessage`. If the client is too slow, feedback is dropped."""

    def respond(self, response: Message, goal_id: bytes) -> None:
        """Sends the last reply: the response of the service `get_result`, and the identifier of the goal."""

    def refuse(self, reason: str) -> None:
        """Sends an error reply as the last reply."""


@dataclass(frozen=True, slots=True)
class ActionCallbacks:
    """What the transport calls, on its threads; each callback may only enqueue.

    Attributes:
        send_goal: Called with each request to the service of this name.
        cancel_goal: As above.
        get_result: As above.
        query: Called with each query on the action's own name.
    """

    send_goal: Callable[[Call], None]
    cancel_goal: Callable[[Call], None]
    get_result: Callable[[Call], None]
    query: Callable[[GoalQuery], None]


@dataclass(frozen=True, slots=True)
class ActionPublishers:
    """The publishers of an action's topics."""

    feedback: Publisher[Any]
    status: Publisher[GoalStatusArray]


class ActionTransport(Transport, Protocol):
    """A transport that also declares actions."""

    def open_action(self, action: ActionName, callbacks: ActionCallbacks) -> ActionPublishers:
        """Declares the services and topics of an action, and its own name; returns the publishers."""
