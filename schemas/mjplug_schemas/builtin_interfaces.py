"""The ROS package builtin_interfaces: points in time and lengths of time."""

from typing import Self

from pydantic import Field

from mjplug_schemas.idl import int32, uint32
from mjplug_schemas.message import Message

_SECOND = 1_000_000_000


class Time(Message):
    """A point in time; the message that contains it defines the clock."""

    sec: int32 = Field(0, description="Whole seconds since the clock's origin, rounded down [s].")
    nanosec: uint32 = Field(0, description="Nanoseconds past `sec`, from 0 to 999999999 [ns].")

    @classmethod
    def from_ns(cls, ns: int) -> Self:
        """Returns the time that is `ns` nanoseconds after the clock's origin."""
        sec, nanosec = divmod(ns, _SECOND)
        return cls(sec=sec, nanosec=nanosec)

    def to_ns(self) -> int:
        """Returns the nanoseconds since the clock's origin."""
        return self.sec * _SECOND + self.nanosec


class Duration(Message):
    """A length of time, which may be negative."""

    sec: int32 = Field(0, description="Whole seconds, rounded down [s].")
    nanosec: uint32 = Field(0, description="Nanoseconds to add to `sec`, from 0 to 999999999, even if negative [ns].")

    @classmethod
    def from_ns(cls, ns: int) -> Self:
        """Returns the duration of `ns` nanoseconds."""
        sec, nanosec = divmod(ns, _SECOND)
        return cls(sec=sec, nanosec=nanosec)

    def to_ns(self) -> int:
        """Returns the duration in nanoseconds."""
        return self.sec * _SECOND + self.nanosec
