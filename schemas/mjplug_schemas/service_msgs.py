"""The ROS package service_msgs: messages of service introspection."""

from typing import Annotated, ClassVar

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.idl import Exactly, char_sequence, int64, uint8
from mjplug_schemas.message import Message


class ServiceEventInfo(Message):
    """One step of one service call; part of every service's type hash."""

    REQUEST_SENT: ClassVar[uint8] = 0
    REQUEST_RECEIVED: ClassVar[uint8] = 1
    RESPONSE_SENT: ClassVar[uint8] = 2
    RESPONSE_RECEIVED: ClassVar[uint8] = 3

    event_type: uint8 = Field(0, description="Which step of the call this is, one of the constants.")
    stamp: Time = Field(Time(), description="When it happened [s, ns].")
    client_gid: Annotated[char_sequence, Exactly(16)] = Field(bytes(16), description="Which client made the call.")
    sequence_number: int64 = Field(0, description="The number of the call, counted by its client.")
