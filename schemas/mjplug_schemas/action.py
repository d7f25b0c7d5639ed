"""The base class of actions, and the services and messages that ROS derives from each of them."""

from typing import Any, ClassVar

from pydantic import Field, create_model

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.idl import boolean, int8
from mjplug_schemas.message import Message, Service
from mjplug_schemas.unique_identifier_msgs import UUID

PARTS = ("Goal", "Result", "Feedback")
"""The nested message classes of an action."""


class Action:
    """A ROS 2 action with three messages, the nested classes `Goal`, `Result` and `Feedback`.

    Attributes:
        TYPE: The ROS type name, such as `control_msgs/action/FollowJointTrajectory`; the messages are `…_Goal`,
            `…_Result` and `…_Feedback`.
        SendGoal: The derived service `…_SendGoal`, which sends a goal.
        GetResult: The derived service `…_GetResult`, which responds with the result when the goal has ended.
        FeedbackMessage: The derived message `…_FeedbackMessage`: feedback, and the identifier of its goal.
    """

    TYPE: ClassVar[str] = ""
    Goal: ClassVar[type[Message]]
    Result: ClassVar[type[Message]]
    Feedback: ClassVar[type[Message]]
    SendGoal: ClassVar[type[Service]]
    GetResult: ClassVar[type[Service]]
    FeedbackMessage: ClassVar[type[Message]]

    def __init_subclass__(cls, package: str | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.TYPE = f"{package or cls.__module__.rpartition('.')[2]}/action/{cls.__name__}"
        for part in PARTS:
            message = vars(cls).get(part)
            if not (isinstance(message, type) and issubclass(message, Message)):
                raise DefinitionError(f"{cls.TYPE} needs a nested class `{part}` that is a Message")
            message.TYPE = f"{cls.TYPE}_{part}"
        identifier = (UUID, Field(UUID(), description="Identifier of the goal, chosen by its client."))
        cls.SendGoal = cls._service(
            "SendGoal",
            "Sends a goal.",
            {"goal_id": identifier, "goal": (cls.Goal, Field(cls.Goal(), description="The goal."))},
            {
                "accepted": (boolean, Field(False, description="Whether the server accepted the goal.")),
                "stamp": (Time, Field(Time(), description="Simulated time at which it was accepted [s, ns].")),
            },
        )
        cls.GetResult = cls._service(
            "GetResult",
            "Waits until a goal has ended, and responds with its result.",
            {"goal_id": identifier},
            {
                "status": (int8, Field(0, description="How the goal ended: a constant of action_msgs/msg/GoalStatus.")),
                "result": (cls.Result, Field(cls.Result(), description="The result.")),
            },
        )
        cls.FeedbackMessage = cls._message(
            "FeedbackMessage",
            "Feedback, and the goal that it belongs to.",
            {
                "goal_id": identifier,
                "feedback": (cls.Feedback, Field(cls.Feedback(), description="The feedback.")),
            },
        )

    @classmethod
    def derived(cls) -> dict[str, type[Message] | type[Service]]:
        """Returns the derived services and messages by type name."""
        parts: list[type[Message] | type[Service]] = [cls.Goal, cls.Result, cls.Feedback]
        parts += [cls.SendGoal, cls.GetResult, cls.FeedbackMessage]
        for service in (cls.SendGoal, cls.GetResult):
            parts += [service.Request, service.Response]
        return {part.TYPE: part for part in parts}

    @classmethod
    def _message(cls, name: str, text: str, fields: dict[str, Any]) -> type[Message]:
        made: type[Message] = create_model(
            f"{cls.__name__}_{name}", __base__=Message, __doc__=text, __module__=cls.__module__, **fields
        )
        made.TYPE = f"{cls.TYPE}_{name}"
        return made

    @classmethod
    def _service(cls, name: str, text: str, request: dict[str, Any], response: dict[str, Any]) -> type[Service]:
        parts = {
            "Request": cls._message(f"{name}_Request", text, request),
            "Response": cls._message(f"{name}_Response", text, response),
        }
        made: Any = type(f"{cls.__name__}_{name}", (Service,), {"__doc__": text, "__module__": cls.__module__, **parts})
        made.TYPE = f"{cls.TYPE}_{name}"
        for part, message in parts.items():
            message.TYPE = f"{made.TYPE}_{part}"
        service: type[Service] = made
        return service
