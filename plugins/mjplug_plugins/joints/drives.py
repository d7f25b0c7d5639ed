"""Determines how each joint is commanded, from own actuators and the configuration."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import cast

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug.plugin.bundled import Drives, float_view
from mjplug_plugins.joints.actuators import Actuator, actuators_of
from mjplug_plugins.joints.coupling import Coupling, Couplings
from mjplug_plugins.joints.derived_drives import DerivedSide
from mjplug_plugins.joints.outputs import DirectOutput, Drive, Output, PidOutput
from mjplug_plugins.joints.parameters import JointCommandsParameters, PidGains, PidGainsByMode
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.scalar_joint import ScalarJoint, chosen, scalar_joints
from mjplug_plugins.joints.transmission import Interface, relations_of

_PID_INTERFACES: dict[Drives, tuple[Interface, ...]] = {
    Drives.POSITION: (),
    Drives.VELOCITY: ("position",),
    Drives.EFFORT: ("position", "velocity"),
    Drives.OTHER: ("position", "velocity"),
}
"""Command interfaces that need a PID, for each kind of actuator."""


class JointDrives:
    """The joints that can be commanded, and their PIDs.

    Attributes:
        drives: Commandable joints, by name.
        passive: Names of joints that cannot be commanded, or that mimic another joint.
        banks: The PIDs for position commands and the PIDs for velocity commands.
        couplings: The commands that transmissions convert.
        gains: The configured gains and the PIDs that they apply to, by name, such as `position.joint1`.

    Args:
        host: Provides the model and the state.
        parameters: The configuration.

    Raises:
        MjplugError: The configuration does not fit the model.
    """

    def __init__(self, host: Host, parameters: JointCommandsParameters) -> None:
        self._host, self._parameters = host, parameters
        self._pid_gains = parameters.pid_gains or PidGainsByMode()
        joints = scalar_joints(host.model)
        self._relations = relations_of(parameters.transmissions, joints)
        actuators = actuators_of(host, joints, parameters.actuators)
        selected = list(joints.values())
        if parameters.joints:
            selected = chosen(joints, self._real([*parameters.joints, *parameters.mimic]), host.model)
        for name in self._real(parameters.joints):
            if name not in actuators:
                raise PluginError(f"joint {name!r} has no actuator; joints with an actuator: {', '.join(actuators)}")
        commanded = {joint.name: (joint, actuators[joint.name]) for joint in selected if joint.name in actuators}
        host.claim_controls([actuator.actuator for _, own in commanded.values() for actuator in own])
        self._check_gains(commanded)
        self._pids: dict[int, list[PidOutput]] = defaultdict(list)
        self.banks: list[PidBank] = []
        self.gains: dict[str, tuple[PidGains, list[tuple[PidBank, int]]]] = {}
        pid_outputs = {interface: self._create_pids(interface, commanded) for interface in ("position", "velocity")}
        self.drives: dict[str, Drive] = {}
        for name, (joint, own) in commanded.items():
            outputs: dict[Interface, list[Output]] = defaultdict(list)
            for actuator in own:
                self._add_direct_output(actuator, own, outputs)
            for interface, by_joint in pid_outputs.items():
                outputs[cast(Interface, interface)] += by_joint.get(name, [])
            available = {interface: own for interface, own in outputs.items() if own}
            self.drives[name] = Drive(joint, available, self._warn_limited)
        self.couplings = Couplings()
        self._add_derived(commanded)
        self._mimic(joints)
        self.passive = joints.keys() - self.drives.keys()

    def stop_all(self) -> None:
        """Stops all PIDs and discards the last commands; the controls do not change."""
        for bank in self.banks:
            bank.stop_all()
        for drive in self.drives.values():
            drive.desired = None
        self.couplings.release()

    def find(self, name: str) -> Drive:
        """Returns the drive of a joint, by name.

        Raises:
            UnknownName: There is no commandable joint of that name.
        """
        if name not in self.drives:
            raise UnknownName("commandable joint", name, self.drives)
        return self.drives[name]

    def _real(self, names: Iterable[str]) -> dict[str, None]:
        """Returns names with the joints of the model in place of derived coordinates, each name once."""
        replaced = {name: relation.real for relation in self._relations for name in relation.derived}
        return dict.fromkeys(
            real
            for name in names
            for real in ([joint.name for joint in replaced[name]] if name in replaced else [name])
        )

    def _add_derived(self, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]) -> None:
        """Adds the drives that transmissions derive, except where a joint has no actuator."""
        side = DerivedSide(self._host, self._pid_gains, self._warn_limited)
        for relation in self._relations:
            if not all(joint.name in self.drives for joint in relation.real):
                continue
            real = [self.drives[joint.name] for joint in relation.real]
            # A direct command for an actuator of the model also stops the PIDs of derived coordinates that move it.
            pids = [self._pids[actuator.actuator] for joint in relation.real for actuator in commanded[joint.name][1]]
            derived = side.drives(relation, real, pids)
            self.couplings.add(Coupling(relation, real, derived, self._host.data))
            self.drives |= {drive.joint.name: drive for drive in derived if drive.outputs}
        self.banks += side.banks
        self.gains |= side.gains

    def _warn_limited(self, message: str) -> None:
        self._host.logger.warning("%s and was limited (reported once)", message)

    def _add_direct_output(
        self, actuator: Actuator, own: list[Actuator], outputs: dict[Interface, list[Output]]
    ) -> None:
        kind = actuator.law.drives
        ratio, offset = actuator.scale(kind)
        if kind is Drives.EFFORT:
            # The effort actuators of a joint share the commanded effort.
            share = sum(other.law.drives is Drives.EFFORT for other in own)
            ratio /= share
        elif kind is Drives.OTHER:
            ratio, offset = 1.0, 0.0
        interface = cast(Interface, "effort" if kind is Drives.OTHER else str(kind))
        limits = actuator.limits(self._host.model, self._parameters.clamp)
        pids = self._pids[actuator.actuator]
        controls = float_view(self._host.data.ctrl)
        outputs[interface].append(DirectOutput(controls, actuator.actuator, ratio, offset, limits, pids))

    def _create_pids(
        self, interface: str, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]
    ) -> dict[str, list[PidOutput]]:
        """Creates the PIDs for one kind of command; returns them by joint name."""
        model, data = self._host.model, self._host.data
        rows = [
            (joint, actuator, name)
            for joint, own in commanded.values()
            for actuator in own
            if interface in _PID_INTERFACES[actuator.law.drives]
            and (name := self._gains_name(interface, joint, actuator)) is not None
        ]
        if not rows:
            return {}
        position = interface == "position"
        by_name: dict[str, PidGains] = getattr(self._pid_gains, interface)
        bank = PidBank(
            [by_name[name] for _, _, name in rows],
            data.qpos if position else data.qvel,
            [joint.qpos if position else joint.dof for joint, _, _ in rows],
            data.ctrl,
            [actuator.actuator for _, actuator, _ in rows],
            [actuator.limits(model, self._parameters.clamp) for _, actuator, _ in rows],
            float(model.opt.timestep),
        )
        self.banks.append(bank)
        by_joint: dict[str, list[PidOutput]] = defaultdict(list)
        for pid, (joint, actuator, name) in enumerate(rows):
            self.gains.setdefault(f"{interface}.{name}", (by_name[name], []))[1].append((bank, pid))
            pids = self._pids[actuator.actuator]
            pids.append(PidOutput(bank, pid, pids))
            by_joint[joint.name].append(pids[-1])
        return by_joint

    def _gains_name(self, interface: str, joint: ScalarJoint, actuator: Actuator) -> str | None:
        """Returns the name under which the gains of an actuator are configured, its own or that of the joint."""
        by_name: dict[str, PidGains] = getattr(self._pid_gains, interface)
        return next((name for name in (actuator.name, joint.name) if name in by_name), None)

    def _check_gains(self, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]) -> None:
        derived = {name for relation in self._relations for name in relation.derived}
        known = derived | {
            name for joint, own in commanded.items() for name in (joint, *(a.name for a in own[1])) if name
        }
        for interface in ("position", "velocity"):
            for name in getattr(self._pid_gains, interface):
                if name not in known:
                    raise UnknownName(f"joint or actuator with {interface} gains", name, known)
                if name not in derived and not any(
                    interface in _PID_INTERFACES[a.law.drives] for a in _named(name, commanded)
                ):
                    self._host.logger.warning(
                        "the %s gains of %s are not used: its actuator follows such commands by itself, or cannot",
                        interface,
                        name,
                    )

    def _mimic(self, joints: Mapping[str, ScalarJoint]) -> None:
        for name, mimic in self._parameters.mimic.items():
            if name not in joints:
                raise UnknownName("joint", name, joints)
            if name not in self.drives:
                raise PluginError(
                    f"joint {name!r} cannot mimic {mimic.joint!r}, because it has no actuator; if the model couples "
                    "them, remove the mimic entry"
                )
            if mimic.joint in self._parameters.mimic:
                raise PluginError(f"joint {name!r} mimics {mimic.joint!r}, which itself mimics another joint")
            leader, follower = self.find(mimic.joint), self.drives[name]
            missing = [interface for interface in leader.outputs if interface not in follower.outputs]
            if missing and len(missing) == len(leader.outputs):
                raise PluginError(
                    f"joint {name!r} accepts {follower.accepted} commands, but {mimic.joint!r}, which it mimics, "
                    f"accepts {' and '.join(missing)} commands"
                )
            for interface in missing:
                self._host.logger.warning("joint %s does not mimic the %s of %s", name, interface, mimic.joint)
            leader.followers.append((follower, mimic.multiplier, mimic.offset))
        for name in self._parameters.mimic:
            # A joint that mimics another one cannot be commanded itself.
            del self.drives[name]


def _named(name: str, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]) -> Iterator[Actuator]:
    """Yields the actuators that gains with this joint or actuator name apply to."""
    for joint, (_, own) in commanded.items():
        yield from (actuator for actuator in own if name in (joint, actuator.name))
