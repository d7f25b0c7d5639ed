"""The ROS package unique_identifier_msgs: identifiers that any program can choose."""

from typing import Annotated

from pydantic import Field

from mjplug_schemas.idl import Exactly, uint8_sequence
from mjplug_schemas.message import Message


class UUID(Message):
    """A universally unique identifier (RFC 4122)."""

    uuid: Annotated[uint8_sequence, Exactly(16)] = Field(bytes(16), description="The 16 bytes of the identifier.")
