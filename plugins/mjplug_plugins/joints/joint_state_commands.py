"""Reads the commands for each joint from JointState messages."""

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

from mjplug.plugin import RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.outputs import MAX_VALUE, Drive, refuse_both_sides
from mjplug_plugins.joints.transmission import Interface
from mjplug_schemas.sensor_msgs import JointState

ORDER: tuple[Interface, ...] = ("effort", "velocity", "position")
"""Order in which commands are applied: an actuator follows the last one that it accepts."""

_MAX_IGNORED = 20
"""Number of ignored names that are stored, so that invented names cannot fill the log or the memory."""

Command = tuple[Drive, Interface, float]

Slot = tuple[int, Drive]
"""An index in a list of numbers, and the joint that the number is for."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """The joints that the lists of a message refer to.

    Attributes:
        names: The joint names in the message.
        lengths: The lengths of its lists, in the order of `ORDER`.
        slots: For each list, its indices and their joints.
    """

    names: Sequence[str]
    lengths: tuple[int, ...]
    slots: dict[Interface, list[Slot]]


class JointStateCommands:
    """Reads JointState messages; the layout of the last message is cached, because it rarely changes.

    Attributes:
        ignored: Joint names whose commands were ignored so far, with the reason.

    Args:
        drives: The commandable joints, by name.
        passive: Names of other joints of the model.
        declared: The command interfaces of joints, where they are configured.
    """

    def __init__(
        self, drives: Mapping[str, Drive], passive: Set[str], declared: Mapping[str, Sequence[Interface]]
    ) -> None:
        self._drives, self._passive, self._declared = drives, passive, declared
        self._layout: _Layout | None = None
        self.ignored: dict[str, str] = {}

    def read(self, message: JointState) -> list[Command]:
        """Returns the commands of a message in the order to apply them; NaN means no command.

        Raises:
            RequestError: The names or the lengths of the lists are invalid, or a number is infinite or too large.
        """
        lengths = tuple(len(getattr(message, interface)) for interface in ORDER)
        layout = self._layout
        if layout is None or layout.names != message.name or layout.lengths != lengths:
            layout = self._layout = self._arrange(message, lengths)
        commands: list[Command] = []
        for interface, slots in layout.slots.items():
            commands += commands_for(interface, slots, getattr(message, interface))
        return commands

    def _arrange(self, message: JointState, lengths: tuple[int, ...]) -> _Layout:
        names = message.name
        first: dict[str, int] = {}
        for index, name in enumerate(names):
            if first.setdefault(name, index) != index:
                raise RequestError(f"joint {quoted(name)} is listed twice: name[{first[name]}] and name[{index}]")
        slots: dict[Interface, list[Slot]] = {}
        for interface, length in zip(ORDER, lengths, strict=True):
            if length:
                indices = self._indices(interface, names, length)
                slots[interface] = [
                    (index, drive) for index, name in indices if (drive := self._accepting_drive(name, interface))
                ]
        refuse_both_sides(drive for own in slots.values() for _, drive in own)
        return _Layout(names, lengths, slots)

    def _indices(self, interface: Interface, names: Sequence[str], length: int) -> list[tuple[int, str]]:
        """Returns each index of a list with its joint name."""
        declared = self._declared
        if length == len(names):
            return [
                (index, name) for index, name in enumerate(names) if name not in declared or interface in declared[name]
            ]
        # JointStateTopicSystem appends values only for the joints that have the interface.
        declaring = [name for name in names if interface in declared.get(name, ())]
        if length == len(declaring):
            return list(enumerate(declaring))
        configured = f"command_interfaces declares it for {len(declaring)} of the names" if declared else ""
        raise RequestError(
            f"the length of {interface} is {length}, but that of name is {len(names)}; send one number for each name, "
            "or none"
            + (f" ({configured})" if configured else "; or declare the interfaces of the joints in command_interfaces")
        )

    def _accepting_drive(self, name: str, interface: Interface) -> Drive | None:
        drive = self._drives.get(name)
        if drive is not None and interface in drive.outputs:
            return drive
        if drive is not None:
            hint = "" if interface == "effort" else f"; set pid_gains.{interface}.{name} to allow it"
            reason = f"it accepts {drive.accepted} commands, not {interface}{hint}"
        elif name in self._passive:
            reason = "it has no actuator, mimics another joint, or is not in `joints`"
        else:
            reason = "there is no commandable joint of that name"
        if len(self.ignored) < _MAX_IGNORED:
            self.ignored.setdefault(name, reason)
        return None


def commands_for(interface: Interface, slots: Iterable[Slot], values: Sequence[float]) -> list[Command]:
    """Returns the commands in a list of numbers; NaN means no command.

    Raises:
        RequestError: A number is infinite, or so large that MuJoCo would treat it as a divergence.
    """
    commands = []
    for index, drive in slots:
        value = values[index]
        # The comparison is false for NaN too.
        if abs(value) <= MAX_VALUE:
            commands.append((drive, interface, value))
        elif not math.isnan(value):
            raise RequestError(
                f"the {interface} of joint {quoted(drive.joint.name)} is {value:g}; it must be finite and below "
                f"{MAX_VALUE:g}"
            )
    return commands
