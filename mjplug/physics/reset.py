"""Resets the world to a keyframe or the initial state, then applies overrides of joints and free bodies."""

from dataclasses import dataclass, field

from mjplug.physics import free_joint
from mjplug.physics.free_joint import FreeJointTarget
from mjplug.physics.simulation import Simulation


@dataclass(frozen=True, slots=True)
class JointOverride:
    """Target state of a hinge or slide joint; None keeps the value of the keyframe or initial state.

    Attributes:
        joint: The joint's id.
        position: Position, [rad] for a hinge, [m] for a slide.
        velocity: Velocity, [rad/s] for a hinge, [m/s] for a slide.
    """

    joint: int
    position: float | None
    velocity: float | None


@dataclass(frozen=True, slots=True)
class Reset:
    """A validated reset. The default resets to the initial state.

    Attributes:
        keyframe: Id of the keyframe; None means the initial state.
        joints: Joint overrides.
        free_joints: Targets of free bodies, applied after the joint overrides. Their frames are the body poses after
            the joint overrides.
        episode: The new `Simulation.lineage`. Step number and simulated time begin at 0 then, so that everything
            depends on this number and not on the past. None lets simulated time continue.
    """

    keyframe: int | None = None
    joints: list[JointOverride] = field(default_factory=list)
    free_joints: list[FreeJointTarget] = field(default_factory=list)
    episode: int | None = None

    def apply(self, simulation: Simulation) -> None:
        """Sets the state and updates all derived quantities."""
        if self.episode is not None:
            simulation.step = 0
            simulation.time.restart(0)
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
        simulation.lineage = simulation.lineage + 1 if self.episode is None else self.episode
