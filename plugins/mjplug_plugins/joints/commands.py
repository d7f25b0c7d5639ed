"""Moves joints by commands: JointState messages, number arrays for groups of joints, and trajectories."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from mjplug.plugin import DEFAULT, Diagnosis, Host, Level, Plugin, PluginError, QoS, RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.drives import JointDrives
from mjplug_plugins.joints.follow_joint_trajectory import FollowJointTrajectoryAction
from mjplug_plugins.joints.grippers import GripperAction
from mjplug_plugins.joints.joint_state_commands import Command, JointStateCommands, commands_for
from mjplug_plugins.joints.outputs import Drive
from mjplug_plugins.joints.parameters import Constraints, Group, JointCommandsParameters, PidGains
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.trajectories import Trajectories
from mjplug_plugins.joints.transmission import Interface
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Float64MultiArray
from mjplug_schemas.trajectory_msgs import JointTrajectory


class JointCommands(Plugin[JointCommandsParameters]):
    """Moves hinges and slides by `JointState`, `Float64MultiArray` and `JointTrajectory` commands.

    Each joint follows its last command, from any topic, until it gets another one. An actuator that follows the kind of
    command by itself, such as a position servo, gets the target as its control. For other actuators, a PID computes
    the control at every step. An invalid message moves no joint. A reset of the world cancels all commands.
    """

    accepted = 0
    """Number of accepted messages."""

    refused = 0
    """Number of refused messages."""

    def init(self, host: Host, parameters: JointCommandsParameters) -> None:
        """Finds the actuators and PIDs of each joint, and creates the subscribers."""
        self._host, self._parameters = host, parameters
        self._joints = JointDrives(host, parameters)
        drives = self._joints.drives
        for name in parameters.command_interfaces:
            self._joints.find(name)
        if not drives:
            host.logger.warning("no hinge or slide of the model has an actuator: nothing can be commanded")
        for name in (name for name, drive in drives.items() if not drive.outputs):
            host.logger.warning("joint %s cannot be commanded: its actuators accept no command", name)
        self._trajectories = Trajectories(host, self._joints, parameters.interpolate_from_desired_state)
        self._expiries: dict[tuple[Drive, Interface], int] = {}
        self._next_expiry = 0
        self._timeout = host.steps_covering(round(parameters.command_timeout * 1e9))
        self._last_refusal = ""
        self._refused_by_topic: dict[str, int] = {}
        self._reader = JointStateCommands(drives, self._joints.passive, parameters.command_interfaces)
        self._reported: set[str] = set()
        self._subscribe(JointState, parameters.topic, self._handle_joint_state)
        self._subscribe(
            JointTrajectory, parameters.trajectory_topic, self._trajectories.start, self._trajectories.checked
        )
        name, constraints = parameters.trajectory_action, parameters.constraints or Constraints()
        for joint in (*constraints.trajectory, *constraints.goal):
            self._joints.find(joint)
        FollowJointTrajectoryAction(host, name, self._trajectories, constraints, self._wake)
        for name, gripper in parameters.grippers.items():
            GripperAction(host, name, gripper, self._joints.find(gripper.joint), self._trajectories, self._wake)
        for name, group in parameters.groups.items():
            self._add_group(name, group)
        for name, (gains, pids) in self._joints.gains.items():
            host.create_parameters(f"pid_gains.{name}", gains, partial(_set_gains, pids))
        host.create_diagnostic("", self._diagnose)
        self._hold()

    def update(self) -> None:
        """Advances the trajectories and computes the PIDs for the next step."""
        if self._trajectories.running:
            self._trajectories.update()
        if self._expiries and self._host.step >= self._next_expiry:
            self._expire()
        self._joints.couplings.apply()
        pid_running = False
        for bank in self._joints.banks:
            if bank.count:
                bank.update()
                pid_running = True
        if not (pid_running or self._trajectories.running or self._expiries):
            self._host.deactivate()

    def on_reset(self) -> None:
        """Cancels all commands; the controls are those of the reset."""
        self._trajectories.clear()
        self._expiries.clear()
        self._joints.stop_all()
        self._host.deactivate()
        self._hold()

    def save(self) -> dict[str, Any]:
        """Returns PIDs, trajectories, the last positions and the commands that expire."""
        step, joints = self._host.step, self._joints
        banks = {
            f"bank{number}_{name}": array
            for number, bank in enumerate(joints.banks)
            for name, array in bank.save().items()
        }
        return {
            **banks,
            **self._trajectories.save(),
            "coupled": joints.couplings.save(),
            "desired": {name: drive.desired for name, drive in joints.drives.items()},
            "expiries": [
                (drive.joint.name, interface, until - step) for (drive, interface), until in self._expiries.items()
            ],
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets what `save` has returned; the controls are part of the state of the simulation."""
        step, joints = self._host.step, self._joints
        banks = [
            {name: saved.get(f"bank{number}_{name}") for name in bank.save()}
            for number, bank in enumerate(joints.banks)
        ]
        if not all(bank.fits(own) for bank, own in zip(joints.banks, banks, strict=True)):
            raise RequestError("the PIDs are different now")
        tracks = self._trajectories.restored(saved)
        desired = {
            joints.find(name): None if value is None else float(value) for name, value in saved["desired"].items()
        }
        expiries = {(joints.find(name), interface): step + int(left) for name, interface, left in saved["expiries"]}
        if not all(interface in drive.outputs for drive, interface in expiries):
            raise RequestError("a joint accepts other commands now")
        for bank, own in zip(joints.banks, banks, strict=True):
            bank.restore(own)
        for drive, value in desired.items():
            drive.desired = value
        joints.couplings.restore(saved.get("coupled", {}))
        self._trajectories.resume(tracks)
        self._expiries = expiries
        self._next_expiry = min(expiries.values(), default=0)

    def cleanup(self) -> None:
        """Logs how many messages were refused, if more than the one that was reported."""
        for topic, count in getattr(self, "_refused_by_topic", {}).items():
            if count > 1:
                self._host.logger.warning("%d messages on %s were refused in all", count, topic)

    @property
    def _busy(self) -> bool:
        joints = self._joints
        running = self._trajectories.running or joints.couplings.pending
        return running or bool(self._expiries) or any(bank.count for bank in joints.banks)

    def _hold(self) -> None:
        if self._parameters.hold_at_start:
            for drive in self._joints.drives.values():
                if drive.has_position_pid:
                    drive.command("position", drive.joint.position(self._host.data))
        self._wake()

    def _wake(self) -> None:
        if self._busy:
            self._host.activate()

    def _subscribe(
        self,
        type: type[Any],
        topic: str,
        handle: Callable[[Any], object],
        check: Callable[[Any], Any] | None = None,
    ) -> None:
        """Subscribes to a topic.

        Args:
            type: Message class.
            topic: Name of the topic.
            handle: Handles a message.
            check: Checks a message on the thread of the transport; `handle` gets the result.
        """

        def checked(message: Any) -> Any:
            # Returned instead of raised, because refusals are counted by the handler.
            try:
                return check(message) if check is not None else message
            except RequestError as error:
                return error

        # The queue keeps several messages, because each message between two steps may command another joint.
        qos = QoS(max(DEFAULT.depth, len(self._joints.drives)))
        receive = partial(self._receive, self._host.full_name(topic), handle)
        self._host.create_subscription(type, topic, receive, qos, prepare=None if check is None else checked)

    def _receive(self, topic: str, handle: Callable[[Any], object], message: Any) -> None:
        try:
            if isinstance(message, RequestError):
                raise message
            handle(message)
        except RequestError as error:
            self._refuse(topic, str(error))
        else:
            self.accepted += 1
            self._wake()

    def _refuse(self, topic: str, reason: str) -> None:
        self.refused += 1
        self._last_refusal = f"{topic}: {reason}"
        self._refused_by_topic[topic] = self._refused_by_topic.get(topic, 0) + 1
        if self._refused_by_topic[topic] == 1:
            self._host.logger.warning("a message on %s was refused: %s (further ones are only counted)", topic, reason)

    def _handle_joint_state(self, message: JointState) -> None:
        commands = self._reader.read(message)
        for name, reason in self._reader.ignored.items():
            if name not in self._reported:
                self._reported.add(name)
                self._host.logger.warning("commands for joint %s are ignored: %s", quoted(name), reason)
        self._follow(commands)

    def _handle_numbers(
        self, group: str, drives: Sequence[Drive], interface: Interface, message: Float64MultiArray
    ) -> None:
        if len(message.data) != len(drives):
            raise RequestError(
                f"data contains {len(message.data)} numbers, but group {group!r} has {len(drives)} joints"
            )
        self._follow(commands_for(interface, enumerate(drives), message.data))

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
            if group.interface not in drive.outputs:
                raise PluginError(
                    f"group {name!r}: joint {drive.joint.name!r} accepts {drive.accepted} commands, not "
                    f"{group.interface}"
                )
        handle = partial(self._handle_numbers, name, drives, group.interface)
        self._subscribe(Float64MultiArray, group.topic or f"{name}/commands", handle)

    def _diagnose(self) -> Diagnosis:
        refusal, self._last_refusal = self._last_refusal, ""
        values = {
            "messages accepted": self.accepted,
            "messages refused": self.refused,
            "joints in a trajectory": self._trajectories.count,
            "PIDs running": sum(bank.count for bank in self._joints.banks),
            "ignored names": ", ".join(sorted(self._reader.ignored)[:20]),
        }
        if refusal:
            return Diagnosis(Level.WARN, refusal, values)
        return Diagnosis(values=values)


def _set_gains(pids: Sequence[tuple[PidBank, int]], gains: PidGains) -> None:
    for bank, pid in pids:
        bank.set_gains(pid, gains)
