"""Puts together how each joint of a model is commanded, from what it has and what is configured."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import cast

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug.plugin.bundled import Drives, float_view
from mjplug_plugins.joints.actuators import Actuator, actuators_of
from mjplug_plugins.joints.parameters import Interface, JointCommandsParameters, PidGains, PidGainsByMode
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.route import Direct, Drive, Regulated, Route
from mjplug_plugins.joints.scalar_joint import ScalarJoint, chosen, scalar_joints

_REGULATED: dict[Drives, tuple[Interface, ...]] = {
    Drives.POSITION: (),
    Drives.VELOCITY: ("position",),
    Drives.EFFORT: ("position", "velocity"),
    Drives.OTHER: ("position", "velocity"),
}
"""What a PID can make an actuator follow that it does not follow by itself."""


class JointDrives:
    """The joints that can be commanded, and their PIDs.

    Attributes:
        drives: By name of the joint.
        passive: Joints that nothing can command, or that follow another one.
        banks: The PIDs that follow positions, and those that follow velocities.

    Args:
        host: Whose model it is.
        parameters: The configuration.

    Raises:
        MjplugError: The configuration does not fit the model.
    """

    def __init__(self, host: Host, parameters: JointCommandsParameters) -> None:
        self._host, self._parameters = host, parameters
        self._pid_gains = parameters.pid_gains or PidGainsByMode()
        joints = scalar_joints(host.model)
        actuators = actuators_of(host, joints, parameters.actuators)
        wanted = list(joints.values())
        if parameters.joints:
            wanted = chosen(joints, dict.fromkeys([*parameters.joints, *parameters.mimic]), host.model)
        for name in parameters.joints:
            if name not in actuators:
                raise PluginError(f"joint {name!r} has no actuator; those that have one: {', '.join(actuators)}")
        commanded = {joint.name: (joint, actuators[joint.name]) for joint in wanted if joint.name in actuators}
        host.claim_controls([actuator.actuator for _, its in commanded.values() for actuator in its])
        self._check_gains(commanded)
        self._rivals: dict[int, list[Regulated]] = defaultdict(list)
        self.banks: list[PidBank] = []
        regulated = {interface: self._regulated(interface, commanded) for interface in ("position", "velocity")}
        self.drives: dict[str, Drive] = {}
        for name, (joint, its) in commanded.items():
            routes: dict[Interface, list[Route]] = defaultdict(list)
            for actuator in its:
                self._direct(actuator, its, routes)
            for interface, by_joint in regulated.items():
                routes[cast(Interface, interface)] += by_joint.get(name, [])
            usable = {interface: ways for interface, ways in routes.items() if ways}
            self.drives[name] = Drive(joint, usable, self._say_once)
        self._mimic(joints)
        self.passive = joints.keys() - self.drives.keys()

    def stop_all(self) -> None:
        """Stops all PIDs and forgets what the joints were told; controls stay as they are."""
        for bank in self.banks:
            bank.stop_all()
        for drive in self.drives.values():
            drive.desired = None

    def find(self, name: str) -> Drive:
        """Returns the drive of a joint.

        Raises:
            UnknownName: There is none that can be commanded.
        """
        if name not in self.drives:
            raise UnknownName("joint to command", name, self.drives)
        return self.drives[name]

    def _say_once(self, sentence: str) -> None:
        self._host.logger.warning("%s, and is limited (said once)", sentence)

    def _direct(self, actuator: Actuator, its: list[Actuator], routes: dict[Interface, list[Route]]) -> None:
        kind = actuator.law.drives
        ratio, offset = actuator.scale(kind)
        if kind is Drives.EFFORT:
            # Together they are to exert what is asked for.
            share = sum(other.law.drives is Drives.EFFORT for other in its)
            ratio /= share
        elif kind is Drives.OTHER:
            ratio, offset = 1.0, 0.0
        interface = cast(Interface, "effort" if kind is Drives.OTHER else str(kind))
        limits = actuator.limits(self._host.model, self._parameters.clamp)
        rivals = self._rivals[actuator.actuator]
        controls = float_view(self._host.data.ctrl)
        routes[interface].append(Direct(controls, actuator.actuator, ratio, offset, limits, rivals))

    def _regulated(
        self, interface: str, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]
    ) -> dict[str, list[Regulated]]:
        """Makes the bank of one kind of command; returns its PIDs by joint."""
        model, data = self._host.model, self._host.data
        rows = [
            (joint, actuator, gains)
            for joint, its in commanded.values()
            for actuator in its
            if interface in _REGULATED[actuator.law.drives]
            and (gains := self._gains(interface, joint, actuator)) is not None
        ]
        if not rows:
            return {}
        position = interface == "position"
        bank = PidBank(
            [gains for _, _, gains in rows],
            data.qpos if position else data.qvel,
            [joint.qpos if position else joint.dof for joint, _, _ in rows],
            data.ctrl,
            [actuator.actuator for _, actuator, _ in rows],
            [actuator.limits(model, self._parameters.clamp) for _, actuator, _ in rows],
            float(model.opt.timestep),
        )
        self.banks.append(bank)
        found: dict[str, list[Regulated]] = defaultdict(list)
        for pid, (joint, actuator, _) in enumerate(rows):
            rivals = self._rivals[actuator.actuator]
            rivals.append(Regulated(bank, pid, rivals))
            found[joint.name].append(rivals[-1])
        return found

    def _gains(self, interface: str, joint: ScalarJoint, actuator: Actuator) -> PidGains | None:
        by_name: dict[str, PidGains] = getattr(self._pid_gains, interface)
        return by_name.get(actuator.name) or by_name.get(joint.name)

    def _check_gains(self, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]) -> None:
        known = {name for joint, its in commanded.items() for name in (joint, *(a.name for a in its[1])) if name}
        for interface in ("position", "velocity"):
            for name in getattr(self._pid_gains, interface):
                if name not in known:
                    raise UnknownName(f"joint or actuator with {interface} gains", name, known)
                if not any(interface in _REGULATED[a.law.drives] for a in _named(name, commanded)):
                    self._host.logger.warning(
                        "the %s gains of %s are not used: its actuator does that by itself or cannot", interface, name
                    )

    def _mimic(self, joints: Mapping[str, ScalarJoint]) -> None:
        for name, mimic in self._parameters.mimic.items():
            if name not in joints:
                raise UnknownName("joint", name, joints)
            if name not in self.drives:
                raise PluginError(
                    f"joint {name!r} cannot mimic {mimic.joint!r}, as it has no actuator; if the model couples them, "
                    "leave it out"
                )
            if mimic.joint in self._parameters.mimic:
                raise PluginError(f"joint {name!r} mimics {mimic.joint!r}, which mimics another one itself")
            leader, follower = self.find(mimic.joint), self.drives[name]
            missing = [interface for interface in leader.routes if interface not in follower.routes]
            if missing and len(missing) == len(leader.routes):
                can = " and ".join(follower.routes) or "nothing"
                raise PluginError(
                    f"joint {name!r} takes {can}; {mimic.joint!r}, to mimic, takes {' and '.join(missing)}"
                )
            for interface in missing:
                self._host.logger.warning("joint %s does not mimic the %s of %s", name, interface, mimic.joint)
            leader.followers.append((follower, mimic.multiplier, mimic.offset))
        for name in self._parameters.mimic:
            # Only the joint that they follow is commanded.
            del self.drives[name]


def _named(name: str, commanded: Mapping[str, tuple[ScalarJoint, list[Actuator]]]) -> Iterator[Actuator]:
    """Yields the actuators that gains of a name are for."""
    for joint, (_, its) in commanded.items():
        yield from (actuator for actuator in its if name in (joint, actuator.name))
