"""What a JointState message asks of which joint."""

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

from mjplug.plugin import RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.parameters import Interface
from mjplug_plugins.joints.route import LARGEST, Drive
from mjplug_schemas.sensor_msgs import JointState

ORDER: tuple[Interface, ...] = ("effort", "velocity", "position")
"""Where one actuator could follow several commands of a message, it follows the last of these."""

_MOST_IGNORED = 20
"""Names that are remembered, so that nobody fills the log or the memory with made-up ones."""

Command = tuple[Drive, Interface, float]

Slot = tuple[int, Drive]
"""A place in a list of numbers, and the joint that it is for."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """What the lists of a message with some names are for.

    Attributes:
        names: The names of the message.
        lengths: The lengths of its lists, in the order of `ORDER`.
        slots: What each list has for whom.
    """

    names: Sequence[str]
    lengths: tuple[int, ...]
    slots: dict[Interface, list[Slot]]


class JointStateCommands:
    """Reads messages; the layout of the last one is kept, since a stream of them has one and the same.

    Attributes:
        ignored: Names that no message will move, with the reason, as found so far.

    Args:
        drives: The joints that can be commanded, by name.
        passive: Joints of the model that cannot be.
        declared: The interfaces that messages have of a joint, where that is configured.
    """

    def __init__(
        self, drives: Mapping[str, Drive], passive: Set[str], declared: Mapping[str, Sequence[Interface]]
    ) -> None:
        self._drives, self._passive, self._declared = drives, passive, declared
        self._layout: _Layout | None = None
        self.ignored: dict[str, str] = {}

    def read(self, message: JointState) -> list[Command]:
        """Returns the commands of a message, in the order in which to give them. NaN stands for no command.

        Raises:
            RequestError: The message makes no sense as a whole, or has an infinite number.
        """
        lengths = tuple(len(getattr(message, interface)) for interface in ORDER)
        layout = self._layout
        if layout is None or layout.names != message.name or layout.lengths != lengths:
            layout = self._layout = self._arrange(message, lengths)
        commands: list[Command] = []
        for interface, slots in layout.slots.items():
            commands += told(interface, slots, getattr(message, interface))
        return commands

    def _arrange(self, message: JointState, lengths: tuple[int, ...]) -> _Layout:
        names = message.name
        first: dict[str, int] = {}
        for index, name in enumerate(names):
            if first.setdefault(name, index) != index:
                raise RequestError(f"joint {quoted(name)} is name[{first[name]}] and name[{index}]")
        slots: dict[Interface, list[Slot]] = {}
        for interface, length in zip(ORDER, lengths, strict=True):
            if length:
                places = self._places(interface, names, length)
                slots[interface] = [(place, drive) for place, name in places if (drive := self._able(name, interface))]
        return _Layout(names, lengths, slots)

    def _places(self, interface: Interface, names: Sequence[str], length: int) -> list[tuple[int, str]]:
        """Returns each place of a list with the name that it is for."""
        declared = self._declared
        if length == len(names):
            return [
                (index, name) for index, name in enumerate(names) if name not in declared or interface in declared[name]
            ]
        # JointStateTopicSystem appends values only for the joints that have the interface.
        having = [name for name in names if interface in declared.get(name, ())]
        if length == len(having):
            return list(enumerate(having))
        configured = f"by command_interfaces, {len(having)} of the names have it" if declared else ""
        raise RequestError(
            f"{interface} has {length} numbers for {len(names)} names; give one for each name, or none"
            + (f" ({configured})" if configured else "; or say in command_interfaces which joints have which")
        )

    def _able(self, name: str, interface: Interface) -> Drive | None:
        drive = self._drives.get(name)
        if drive is not None and interface in drive.routes:
            return drive
        if drive is not None:
            can = " and ".join(drive.routes) or "nothing"
            way_out = "" if interface == "effort" else f"; pid_gains.{interface}.{name} would let it"
            reason = f"it takes {can}, not {interface}{way_out}"
        elif name in self._passive:
            reason = "it has no actuator, follows another joint, or was not chosen"
        else:
            reason = "there is no such joint to command"
        if len(self.ignored) < _MOST_IGNORED:
            self.ignored.setdefault(name, reason)
        return None


def told(interface: Interface, slots: Iterable[Slot], values: Sequence[float]) -> list[Command]:
    """Returns what a list of numbers tells each joint. NaN stands for no command.

    Raises:
        RequestError: A number is infinite, or so large that MuJoCo would take it for a divergence.
    """
    commands = []
    for place, drive in slots:
        value = values[place]
        # NaN is not below either.
        if abs(value) <= LARGEST:
            commands.append((drive, interface, value))
        elif not math.isnan(value):
            raise RequestError(
                f"the {interface} of joint {quoted(drive.joint.name)} is {value:g}; it must be finite and below "
                f"{LARGEST:g}"
            )
    return commands
