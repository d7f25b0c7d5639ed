"""Resets the world: a keyframe or the initial state, then overrides of joints and free bodies."""

from dataclasses import dataclass, field

from mjplug.physics import free_joint
from mjplug.physics.free_joint import FreeJointTarget
from mjplug.physics.simulation import Simulation


@dataclass(frozen=True, slots=True)
class JointOverride:
    """Position and velocity of a hinge [rad, rad/s] or slide [m, m/s] joint; None leaves what the reset gave."""

    joint: int
    position: float | None
    velocity: float | None


@dataclass(frozen=True, slots=True)
class Reset:
    """A valid reset. The default is the initial state.

    Attributes:
        keyframe: Id of the keyframe to go to; None is the initial state.
        joints: Joint overrides.
        free_joints: Free bodies to place, after the joint overrides; their frames mean the poses after those.
    """

    keyframe: int | None = None
    joints: list[JointOverride] = field(default_factory=list)
    free_joints: list[FreeJointTarget] = field(default_factory=list)

    def apply(self, simulation: Simulation) -> None:
        """Puts the state back and brings everything derived from it up to date; simulated time goes on."""
        simulation.restore(self.keyframe)
        model, data = simulation.model, simulation.data
        for override in self.joints:
            if override.position is not None:
                data.qpos[model.jnt_qposadr[override.joint]] = override.position
            if override.velocity is not None:
                data.qvel[model.jnt_dofadr[override.joint]] = override.velocity
        if self.free_joints:
            free_joint.apply(simulation, self.free_joints)
        simulation.forward()
        simulation.epoch += 1
