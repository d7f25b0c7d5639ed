"""The ROS package diagnostic_msgs: the status of the parts of a robot."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.idl import byte, sequence, string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import Header


class KeyValue(Message):
    """One value of a part."""

    key: string = Field("", description="Name of the value.")
    value: string = Field("", description="Value as text.")


class DiagnosticStatus(Message):
    """The status of one part."""

    OK: ClassVar[byte] = 0
    WARN: ClassVar[byte] = 1
    ERROR: ClassVar[byte] = 2
    STALE: ClassVar[byte] = 3

    level: byte = Field(0, description="Severity: OK, WARN, ERROR or STALE.")
    name: string = Field("", description="The part, as `<node>: <part>`.")
    message: string = Field("", description="Status in one sentence.")
    hardware_id: string = Field("", description="The device that the part belongs to.")
    values: sequence[KeyValue] = Field((), description="Values of the part.")


class DiagnosticArray(Message):
    """The status of several parts at one time."""

    header: Header = Field(Header(), description="The time of the statuses; no frame is needed.")
    status: sequence[DiagnosticStatus] = Field((), description="The parts.")
