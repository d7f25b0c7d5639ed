"""Moves joints as commands say: single values, groups of numbers, and trajectories."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from mjplug.plugin import DEFAULT, Diagnosis, Host, Level, Plugin, PluginError, QoS, RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.drives import JointDrives
from mjplug_plugins.joints.joint_state_commands import Command, JointStateCommands, told
from mjplug_plugins.joints.parameters import Group, Interface, JointCommandsParameters
from mjplug_plugins.joints.route import Drive
from mjplug_plugins.joints.trajectories import Trajectories
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Float64MultiArray
from mjplug_schemas.trajectory_msgs import JointTrajectory


class JointCommands(Plugin[JointCommandsParameters]):
    """Moves hinges and slides as `sensor_msgs/JointState`, plain numbers and `trajectory_msgs/JointTrajectory` say.

    Each joint follows what it was told last, by whichever topic, until it is told something else. A servo of the model
    gets its target as its control; where an actuator lacks the mode, a PID makes up for it at every step. A message
    that is wrong moves nothing. A reset of the world ends all commands.
    """

    accepted = 0
    """Messages that were followed so far."""

    refused = 0
    """Messages that were not."""

    def init(self, host: Host, parameters: JointCommandsParameters) -> None:
        """Finds out how each joint can be moved, and subscribes."""
        self._host, self._parameters = host, parameters
        self._joints = JointDrives(host, parameters)
        drives = self._joints.drives
        for name in parameters.command_interfaces:
            self._joints.find(name)
        if not drives:
            host.logger.warning("no hinge or slide of the model has an actuator: nothing can be commanded")
        for name in (name for name, drive in drives.items() if not drive.routes):
            host.logger.warning("joint %s cannot be commanded: its actuators take nothing", name)
        self._trajectories = Trajectories(host, self._joints, parameters.interpolate_from_desired_state)
        self._expiries: dict[tuple[Drive, Interface], int] = {}
        self._next_expiry = 0
        self._timeout = host.steps_covering(round(parameters.command_timeout * 1e9))
        self._refusal = ""
        self._wrong: dict[str, int] = {}
        self._reader = JointStateCommands(drives, self._joints.passive, parameters.command_interfaces)
        self._told: set[str] = set()
        self._subscribe(JointState, parameters.topic, self._take_joint_state)
        self._subscribe(JointTrajectory, parameters.trajectory_topic, self._take_trajectory)
        for name, group in parameters.groups.items():
            self._add_group(name, group)
        host.create_diagnostic("", self._diagnose)
        self._hold()

    def update(self) -> None:
        """Moves trajectories on and computes the PIDs, for the coming step."""
        if self._trajectories.running:
            self._trajectories.update()
        if self._expiries and self._host.step >= self._next_expiry:
            self._expire()
        regulating = False
        for bank in self._joints.banks:
            if bank.count:
                bank.update()
                regulating = True
        if not (regulating or self._trajectories.running or self._expiries):
            self._host.deactivate()

    def on_reset(self) -> None:
        """Forgets all commands; the controls are those that the reset has put back."""
        self._trajectories.clear()
        self._expiries.clear()
        self._joints.stop_all()
        self._host.deactivate()
        self._hold()

    def cleanup(self) -> None:
        """Says how many messages were refused, if more than those that were reported."""
        for topic, count in getattr(self, "_wrong", {}).items():
            if count > 1:
                self._host.logger.warning("%d messages on %s were refused in all", count, topic)

    @property
    def _busy(self) -> bool:
        return self._trajectories.running or bool(self._expiries) or any(bank.count for bank in self._joints.banks)

    def _hold(self) -> None:
        if self._parameters.hold_at_start:
            for drive in self._joints.drives.values():
                if drive.is_regulated:
                    drive.command("position", float(self._host.data.qpos[drive.joint.qpos]))
        self._wake()

    def _wake(self) -> None:
        if self._busy:
            self._host.activate()

    def _subscribe(self, type: type[Any], topic: str, take: Callable[[Any], None]) -> None:
        # Not only the newest, since each message between two steps may be for another joint.
        qos = QoS(max(DEFAULT.depth, len(self._joints.drives)))
        self._host.create_subscription(type, topic, partial(self._receive, self._host.full_name(topic), take), qos)

    def _receive(self, topic: str, take: Callable[[Any], None], message: Any) -> None:
        try:
            take(message)
        except RequestError as error:
            self._refuse(topic, str(error))
        else:
            self.accepted += 1
            self._wake()

    def _refuse(self, topic: str, reason: str) -> None:
        self.refused += 1
        self._refusal = f"{topic}: {reason}"
        self._wrong[topic] = self._wrong.get(topic, 0) + 1
        if self._wrong[topic] == 1:
            self._host.logger.warning("a message on %s was refused: %s (further ones are only counted)", topic, reason)

    def _take_joint_state(self, message: JointState) -> None:
        commands = self._reader.read(message)
        for name, reason in self._reader.ignored.items():
            if name not in self._told:
                self._told.add(name)
                self._host.logger.warning("commands for joint %s are ignored: %s", quoted(name), reason)
        self._follow(commands)

    def _take_numbers(
        self, group: str, drives: Sequence[Drive], interface: Interface, message: Float64MultiArray
    ) -> None:
        if len(message.data) != len(drives):
            raise RequestError(f"data has {len(message.data)} numbers for the {len(drives)} joints of group {group!r}")
        self._follow(told(interface, enumerate(drives), message.data))

    def _take_trajectory(self, message: JointTrajectory) -> None:
        self._trajectories.start(message)

    def _follow(self, commands: Sequence[Command]) -> None:
        for drive, interface, value in commands:
            self._trajectories.drop(drive)
            drive.command(interface, value)
        if self._timeout:
            until = self._host.step + self._timeout
            if not self._expiries:
                self._next_expiry = until
            self._expiries |= {(drive, kind): until for drive, kind, value in commands if kind != "position"}

    def _expire(self) -> None:
        step = self._host.step
        for key in [key for key, until in self._expiries.items() if step >= until]:
            drive, interface = key
            del self._expiries[key]
            drive.expire(interface)
        self._next_expiry = min(self._expiries.values(), default=0)

    def _add_group(self, name: str, group: Group) -> None:
        drives = [self._joints.find(joint) for joint in group.joints]
        for drive in drives:
            if group.interface not in drive.routes:
                raise PluginError(
                    f"group {name!r}: joint {drive.joint.name!r} takes {' and '.join(drive.routes) or 'nothing'}, not "
                    f"{group.interface}"
                )
        take = partial(self._take_numbers, name, drives, group.interface)
        self._subscribe(Float64MultiArray, group.topic or f"{name}/commands", take)

    def _diagnose(self) -> Diagnosis:
        refusal, self._refusal = self._refusal, ""
        values = {
            "messages followed": self.accepted,
            "messages refused": self.refused,
            "joints in a trajectory": self._trajectories.count,
            "joints regulated": sum(bank.count for bank in self._joints.banks),
            "names ignored": ", ".join(sorted(self._reader.ignored)[:20]),
        }
        if refusal:
            return Diagnosis(Level.WARN, refusal, values)
        return Diagnosis(values=values)
