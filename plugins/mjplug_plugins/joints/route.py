"""From one command for one joint to the controls of its actuators."""

from collections.abc import Callable
from typing import Protocol

import mujoco

from mjplug_plugins.joints.parameters import Interface
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.scalar_joint import ScalarJoint

LARGEST = 0.99 * mujoco.mjMAXVAL
"""MuJoCo takes a control beyond for a divergence, and drops those of all actuators."""

Say = Callable[[str], None]


class Route(Protocol):
    """How one actuator follows commands of one kind."""

    def command(self, value: float) -> bool:
        """Lets the actuator follow a value from now on; returns whether a limit was in the way."""

    def expire(self) -> None:
        """Makes the value zero, unless the actuator follows a command of another kind by now."""


class Direct:
    """A control that follows from the command at once, and then stays.

    Args:
        ctrl: Where controls go.
        actuator: The actuator.
        ratio: Control per unit of the command.
        offset: Control for a command of zero.
        limits: Of the control.
        rivals: The PIDs of the same actuator; they stop.
    """

    def __init__(
        self,
        ctrl: "memoryview[float]",
        actuator: int,
        ratio: float,
        offset: float,
        limits: tuple[float, float],
        rivals: "list[Regulated]",
    ) -> None:
        self._ctrl, self._actuator = ctrl, actuator
        self._ratio, self._offset = ratio, offset
        self._low, self._high = limits
        self._rivals = rivals

    def command(self, value: float) -> bool:
        """Writes the control."""
        for rival in self._rivals:
            rival.stop()
        wanted = self._ratio * value + self._offset
        control = min(max(wanted, self._low), self._high)
        self._ctrl[self._actuator] = control
        return control != wanted

    def expire(self) -> None:
        """Writes the control for zero."""
        if not any(rival.running for rival in self._rivals):
            self.command(0.0)


class Regulated:
    """A PID that follows the command at every step.

    Args:
        bank: Where it is computed.
        pid: Which of the bank's it is.
        rivals: The PIDs of the same actuator, this one among them; the others stop.
    """

    def __init__(self, bank: PidBank, pid: int, rivals: "list[Regulated]") -> None:
        self._bank, self._pid, self._rivals = bank, pid, rivals

    def command(self, value: float) -> bool:
        """Gives the PID its setpoint."""
        for rival in self._rivals:
            if rival is not self:
                rival.stop()
        self._bank.follow(self._pid, value)
        return False

    @property
    def running(self) -> bool:
        """Whether the actuator follows this PID."""
        return self._bank.runs(self._pid)

    def expire(self) -> None:
        """Makes the setpoint zero."""
        if self.running:
            self._bank.follow(self._pid, 0.0)

    def stop(self) -> None:
        """Lets the actuator keep its control."""
        self._bank.stop(self._pid)


class Drive:
    """One joint and how it is commanded.

    Attributes:
        joint: The joint.
        routes: How each kind of command reaches its actuators; a kind that is missing cannot be commanded.
        followers: Drives that mimic this one, with the multiplier and the offset.
        desired: The position that it was last told [rad, m]; None if it was told something else, or nothing.

    Args:
        joint: The joint.
        routes: As above.
        say: Gets a sentence when a limit is in the way for the first time.
    """

    def __init__(self, joint: ScalarJoint, routes: dict[Interface, list[Route]], say: Say) -> None:
        self.joint = joint
        self.routes = routes
        self.followers: list[tuple[Drive, float, float]] = []
        self.desired: float | None = None
        self._say = say
        self._said = False

    def command(self, interface: Interface, value: float) -> None:
        """Lets the joint, and those that mimic it, follow a value from now on.

        Args:
            interface: What the value is; one that the joint has a route for.
            value: Finite [rad, m, rad/s, m/s, N·m or N].
        """
        limited = False
        for route in self.routes.get(interface, ()):
            limited |= route.command(value)
        if limited and not self._said:
            self._said = True
            self._say(f"joint {self.joint.name!r}: the {interface} {value:g} is beyond what its actuator can be told")
        self.desired = value if interface == "position" else None
        for follower, multiplier, offset in self.followers:
            follower.command(interface, multiplier * value + (offset if interface == "position" else 0.0))

    def expire(self, interface: Interface) -> None:
        """Makes a velocity or an effort zero, here and where it is mimicked, where nothing else was told since."""
        for route in self.routes.get(interface, ()):
            route.expire()
        for follower, _, _ in self.followers:
            follower.expire(interface)

    @property
    def is_regulated(self) -> bool:
        """Whether a PID follows its positions."""
        return any(isinstance(route, Regulated) for route in self.routes.get("position", ()))
