"""The ROS package std_srvs: services for common purposes."""

from pydantic import Field

from mjplug_schemas.idl import boolean, string
from mjplug_schemas.message import Message, Service


class Empty(Service):
    """A request and a response without data."""

    class Request(Message):
        """Nothing."""

    class Response(Message):
        """Nothing."""


class SetBool(Service):
    """Switches something on or off."""

    class Request(Message):
        """The state to set."""

        data: boolean = Field(False, description="True switches on, false switches off.")

    class Response(Message):
        """Whether the request succeeded."""

        success: boolean = Field(False, description="Whether the state was set.")
        message: string = Field("", description="Result as text.")


class Trigger(Service):
    """Triggers an action."""

    class Request(Message):
        """Nothing."""

    class Response(Message):
        """Whether the request succeeded."""

        success: boolean = Field(False, description="Whether the action succeeded.")
        message: string = Field("", description="Result as text.")
