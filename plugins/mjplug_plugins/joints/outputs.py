"""Converts a command for one joint to the controls of its actuators."""

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

import mujoco

from mjplug.plugin import RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.transmission import Interface

MAX_VALUE = 0.99 * mujoco.mjMAXVAL
"""Largest control; MuJoCo treats a larger one as a divergence and discards the controls of all actuators."""

Warn = Callable[[str], None]


class Coordinate(Protocol):
    """A joint, or what a transmission derives from joints."""

    @property
    def name(self) -> str:
        """Its name."""

    def position(self, data: mujoco.MjData) -> float:
        """Returns its position [rad or m]."""

    def velocity(self, data: mujoco.MjData) -> float:
        """Returns its velocity [rad/s or m/s]."""


class Output(Protocol):
    """Makes one actuator follow commands of one kind."""

    def command(self, value: float) -> bool:
        """Sets the value to follow; returns whether it was limited."""

    def expire(self) -> None:
        """Sets the value to zero, unless the actuator follows a command of another kind now."""


class DirectOutput:
    """Computes the control once from the command; the control then stays constant.

    Args:
        ctrl: The array `ctrl` of the state, shape (nu,).
        actuator: Id of the actuator.
        ratio: Control per unit of the command.
        offset: Control for a command of zero.
        limits: Lowest and highest control.
        pids: All PIDs of the actuator; a command stops them.
    """

    def __init__(
        self,
        ctrl: "memoryview[float]",
        actuator: int,
        ratio: float,
        offset: float,
        limits: tuple[float, float],
        pids: "list[PidOutput]",
    ) -> None:
        self._ctrl, self._actuator = ctrl, actuator
        self._ratio, self._offset = ratio, offset
        self._low, self._high = limits
        self._pids = pids

    def command(self, value: float) -> bool:
        """Writes the control for a value and stops the PIDs of the actuator."""
        for other in self._pids:
            other.stop()
        return self.write(value)

    def write(self, value: float) -> bool:
        """Writes the control for a value; returns whether it was limited."""
        unlimited = self._ratio * value + self._offset
        control = min(max(unlimited, self._low), self._high)
        self._ctrl[self._actuator] = control
        return control != unlimited

    def expire(self) -> None:
        """Writes the control for zero, unless a PID of the actuator is running."""
        if not any(other.running for other in self._pids):
            self.command(0.0)


class PidOutput:
    """Makes a PID follow the command at every step.

    Args:
        bank: The bank that computes the PID.
        pid: Index of the PID in the bank.
        pids: All PIDs of the actuator, including this one; a command stops the others.
    """

    def __init__(self, bank: PidBank, pid: int, pids: "list[PidOutput]") -> None:
        self._bank, self._pid, self._pids = bank, pid, pids

    def command(self, value: float) -> bool:
        """Sets the setpoint of the PID and stops the other PIDs of the actuator."""
        for other in self._pids:
            if other is not self:
                other.stop()
        self._bank.follow(self._pid, value)
        return False

    @property
    def running(self) -> bool:
        """Whether the PID is running."""
        return self._bank.runs(self._pid)

    def expire(self) -> None:
        """Sets the setpoint to zero if the PID is running."""
        if self.running:
            self._bank.follow(self._pid, 0.0)

    def stop(self) -> None:
        """Stops the PID; the actuator keeps its control."""
        self._bank.stop(self._pid)


class Drive:
    """One joint and its actuator outputs.

    Attributes:
        joint: The joint.
        outputs: The outputs for each command interface; the joint does not accept the other interfaces.
        followers: Drives that mimic this joint, with multiplier and offset [rad or m].
        others: Drives of the other side of its transmission, which a command for this one replaces.
        on_command: Called with this drive and the interface before a command; None without a transmission.
        desired: The position of the last command [rad or m]; None if the last command was of another kind.

    Args:
        joint: The joint.
        outputs: The outputs for each command interface.
        warn: Called with a message when a command is limited for the first time.
    """

    def __init__(self, joint: Coordinate, outputs: dict[Interface, list[Output]], warn: Warn) -> None:
        self.joint = joint
        self.outputs = outputs
        self.others: Sequence[Drive] = ()
        self.on_command: Callable[[Drive, Interface], None] | None = None
        self.followers: list[tuple[Drive, float, float]] = []
        self.desired: float | None = None
        self._warn = warn
        self._warned = False

    def command(self, interface: Interface, value: float) -> None:
        """Makes the joint and the joints that mimic it follow a value.

        Args:
            interface: Kind of command; the joint must accept it.
            value: Finite value [rad, m, rad/s, m/s, N·m or N].
        """
        if self.on_command is not None:
            self.on_command(self, interface)
        limited = False
        for output in self.outputs.get(interface, ()):
            limited |= output.command(value)
        if limited and not self._warned:
            self._warned = True
            self._warn(
                f"joint {self.joint.name!r}: the {interface} command {value:g} is beyond the range of its actuator"
            )
        self.desired = value if interface == "position" else None
        for follower, multiplier, offset in self.followers:
            follower.command(interface, multiplier * value + (offset if interface == "position" else 0.0))

    def expire(self, interface: Interface) -> None:
        """Sets a velocity or effort to zero for this joint and its followers, unless a later command replaced it."""
        for output in self.outputs.get(interface, ()):
            output.expire()
        for follower, _, _ in self.followers:
            follower.expire(interface)

    @property
    def accepted(self) -> str:
        """The accepted command interfaces, for messages, such as `position and velocity`; else `no`."""
        return " and ".join(self.outputs) or "no"

    @property
    def has_position_pid(self) -> bool:
        """Whether a PID follows position commands."""
        return any(isinstance(output, PidOutput) for output in self.outputs.get("position", ()))


def refuse_both_sides(drives: Iterable[Drive]) -> None:
    """Checks that commands in one message are for one side of each transmission.

    Raises:
        RequestError: They are for both sides.
    """
    chosen = set(drives)
    for drive in chosen:
        for other in drive.others:
            if other in chosen:
                raise RequestError(
                    f"{quoted(drive.joint.name)} and {quoted(other.joint.name)} are two sides of one transmission; "
                    "command either its joints or its actuators"
                )
