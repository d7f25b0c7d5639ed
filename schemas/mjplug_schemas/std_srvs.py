"""The ROS package std_srvs: services that need no types of their own."""

from pydantic import Field

from mjplug_schemas.idl import boolean, string
from mjplug_schemas.message import Message, Service


class Empty(Service):
    """A signal whose only answer is that it arrived."""

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
        """Whether it worked."""

        success: boolean = Field(False, description="Whether the state was set.")
        message: string = Field("", description="What happened, for people to read.")


class Trigger(Service):
    """Makes something happen once."""

    class Request(Message):
        """Nothing."""

    class Response(Message):
        """Whether it worked."""

        success: boolean = Field(False, description="Whether it was done.")
        message: string = Field("", description="What happened, for people to read.")
