"""Creates the drives of the coordinates that a transmission derives, and their PIDs."""

from collections.abc import Sequence

from mjplug.plugin import Host, PluginError
from mjplug_plugins.joints.derived_pids import DerivedEfforts, DerivedPidBank
from mjplug_plugins.joints.outputs import DirectOutput, Drive, Output, PidOutput, Warn
from mjplug_plugins.joints.parameters import PidGains, PidGainsByMode
from mjplug_plugins.joints.pid import PidBank
from mjplug_plugins.joints.transmission import DerivedJoint, Interface, Relation

_CONTROLLED: tuple[Interface, ...] = ("position", "velocity")


class DerivedSide:
    """Creates drives.

    Attributes:
        banks: The created PIDs.
        gains: The gains and PIDs by name, such as `position.actuator1`.

    Args:
        host: Provides the model and the state.
        gains: The configured gains of all PIDs.
        warn: Called with a message when a command is limited.
    """

    def __init__(self, host: Host, gains: PidGainsByMode, warn: Warn) -> None:
        self._host, self._warn = host, warn
        self._configured: dict[Interface, dict[str, PidGains]] = {
            "position": gains.position,
            "velocity": gains.velocity,
        }
        self.banks: list[PidBank] = []
        self.gains: dict[str, tuple[PidGains, list[tuple[PidBank, int]]]] = {}

    def drives(self, relation: Relation, real: Sequence[Drive], pids: Sequence[list[PidOutput]]) -> list[Drive]:
        """Returns the drives of a transmission's derived side; they only accept commands for PIDs of their own.

        Args:
            relation: The transmission.
            real: The drives of its joints in the model.
            pids: The PIDs of each actuator of these joints; they get the new PIDs too.

        Raises:
            PluginError: Only one of two coupled actuators has gains.
        """
        outputs: list[dict[Interface, list[Output]]] = [{} for _ in relation.derived]
        existing = [pid for others in pids for pid in others]
        own: list[list[PidOutput]] = [list(existing) for _ in relation.derived]
        efforts = DerivedEfforts(
            relation,
            [[out for out in drive.outputs.get("effort", ()) if isinstance(out, DirectOutput)] for drive in real],
        )
        for interface in _CONTROLLED:
            if not self._is_controlled(interface, relation, real):
                continue
            bank = self._bank(interface, relation, efforts)
            for row, name in enumerate(relation.derived):
                output = PidOutput(bank, row, own[row])
                for others in (own[row], *pids):
                    others.append(output)
                outputs[row][interface] = [output]
                self.gains[f"{interface}.{name}"] = self._configured[interface][name], [(bank, row)]
        return [
            Drive(DerivedJoint(name, relation, row), outputs[row], self._warn)
            for row, name in enumerate(relation.derived)
        ]

    def _is_controlled(self, interface: Interface, relation: Relation, real: Sequence[Drive]) -> bool:
        """Returns whether PIDs of the derived side follow commands of a kind."""
        names = self._configured[interface]
        given = [name for name in relation.derived if name in names]
        if not given:
            return False
        if any(interface in drive.outputs or "effort" not in drive.outputs for drive in real):
            self._host.logger.warning(
                "the %s gains of %s are not used: they need a motor without such gains at each of the joints %s",
                interface,
                " and ".join(given),
                " and ".join(drive.joint.name for drive in real),
            )
            return False
        for name in relation.derived:
            if name not in names:
                raise PluginError(
                    f"transmission {relation.name!r}: {given[0]!r} has {interface} gains, but {name!r} has none; set "
                    f"pid_gains.{interface}.{name}"
                )
        return True

    def _bank(self, interface: Interface, relation: Relation, efforts: DerivedEfforts) -> PidBank:
        data = self._host.data
        bank = DerivedPidBank(
            [self._configured[interface][name] for name in relation.derived],
            interface,
            relation,
            data.qpos if interface == "position" else data.qvel,
            efforts,
            float(self._host.model.opt.timestep),
        )
        self.banks.append(bank)
        return bank
