"""The ROS package diagnostic_msgs: how the parts of a robot are."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.idl import byte, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class KeyValue(Message):
    """One figure of a part."""

    key: string = Field("", description="What the figure is.")
    value: string = Field("", description="The figure, as text.")


class DiagnosticStatus(Message):
    """How one part is."""

    OK: ClassVar[byte] = 0
    WARN: ClassVar[byte] = 1
    ERROR: ClassVar[byte] = 2
    STALE: ClassVar[byte] = 3

    level: byte = Field(0, description="How grave it is: OK, WARN, ERROR or STALE.")
    name: string = Field("", description="The part, as `<node>: <part>`.")
    message: string = Field("", description="What is the case, in one sentence.")
    hardware_id: string = Field("", description="The device that the part belongs to.")
    values: sequence[KeyValue] = Field((), description="The figures of the part.")


class DiagnosticArray(Message):
    """How several parts are at one time."""

    header: Header = Field(Header(), description="The time of the statuses; no frame is needed.")
    status: sequence[DiagnosticStatus] = Field((), description="The parts.")
