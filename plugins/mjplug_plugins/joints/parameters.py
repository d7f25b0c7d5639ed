"""Parameters of JointCommands."""

from math import isnan
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from mjplug.plugin import OneOrMore, Parameters
from mjplug_plugins.joints.scalar_joint import require_unique
from mjplug_plugins.joints.transmission import Interface, TransmissionParameters

Limit = Annotated[float, Field(allow_inf_nan=True)]

Gain = Annotated[float, Field(ge=-1e12, le=1e12)]
"""Bounded, so that no output overflows: MuJoCo sets all controls to zero if one is not a number."""

Tolerance = Annotated[float, Field(ge=0.0, le=1e9)]

Interfaces = Annotated[tuple[Interface, ...], OneOrMore]
Joints = Annotated[tuple[str, ...], OneOrMore, AfterValidator(require_unique)]


class PidGains(Parameters):
    """Gains of one PID, with control_toolbox's names."""

    p: Gain = Field(default=0.0, description="Proportional gain.")
    i: Gain = Field(default=0.0, description="Integral gain.")
    d: Gain = Field(default=0.0, description="Derivative gain.")
    u_clamp_max: Limit = Field(default=float("inf"), description="Upper limit of the output.")
    u_clamp_min: Limit = Field(default=float("-inf"), description="Lower limit of the output.")
    i_clamp_max: Limit = Field(default=float("inf"), description="Upper limit of the integral term.")
    i_clamp_min: Limit = Field(default=float("-inf"), description="Lower limit of the integral term.")
    antiwindup_strategy: Literal["none", "legacy", "back_calculation", "conditional_integration"] = Field(
        default="none", description="Behaviour of the integral while the output is at its limit."
    )
    tracking_time_constant: float = Field(
        default=0.0, ge=0, description="Time constant of `back_calculation` [s]; 0: sqrt(d / i), or p / i without d."
    )
    error_deadband: float = Field(
        default=0.0, ge=0, description="The integral does not change for errors up to this value."
    )
    antiwindup: bool = Field(
        default=False, description="Accepted for older control_toolbox files; the integral is always limited."
    )
    saturation: bool = Field(
        default=True, description="Accepted for older control_toolbox files; the output is always limited."
    )
    save_i_term: bool = Field(
        default=False, description="Accepted for control_toolbox files; the integral always starts at zero."
    )

    @field_validator("u_clamp_min", "i_clamp_min")
    @classmethod
    def _below_the_upper(cls, low: float, info: ValidationInfo) -> float:
        upper = str(info.field_name).replace("min", "max")
        if not low <= info.data.get(upper, float("inf")):
            raise ValueError(f"{info.field_name} ({low:g}) must not be above {upper} ({info.data[upper]:g})")
        return low

    @model_validator(mode="after")
    def _has_a_time_constant(self) -> Self:
        default = self.antiwindup_strategy == "back_calculation" and not self.tracking_time_constant
        other = self.d or self.p
        # Signs, because a product of small gains may be zero.
        if default and other and self.i and (other < 0) != (self.i < 0):
            raise ValueError(
                f"back_calculation needs a tracking_time_constant above 0, because i ({self.i:g}) and "
                f"{f'd ({self.d:g})' if self.d else f'p ({self.p:g})'} have different signs"
            )
        return self

    @field_validator("u_clamp_max", "i_clamp_max")
    @classmethod
    def _is_a_number(cls, high: float) -> float:
        if isnan(high):
            raise ValueError("the limit must not be NaN")
        return high


class PidGainsByMode(Parameters):
    """PID gains by kind of command."""

    position: dict[str, PidGains] = Field(default={}, description="PID gains, by name of the joint or actuator.")
    velocity: dict[str, PidGains] = Field(default={}, description="PID gains, by name of the joint or actuator.")


class Group(Parameters):
    """Joints that one Float64MultiArray topic commands."""

    joints: Annotated[tuple[str, ...], Field(min_length=1), OneOrMore, AfterValidator(require_unique)] = Field(
        description="The joints, in the order of the numbers."
    )
    interface: Interface = Field(default="position", description="Command interface of the numbers.")
    topic: str = Field(default="", description="Topic name; empty: `<group>/commands`.")


class Mimic(Parameters):
    """A joint that follows the commands of another joint: multiplier · command + offset."""

    joint: str = Field(description="Joint whose commands are followed.")
    multiplier: float = Field(default=1.0, description="Factor for all commands.")
    offset: float = Field(default=0.0, description="Added to positions [rad or m].")


class Constraints(Parameters):
    """Tolerances of FollowJointTrajectory where a goal contains none, as in joint_trajectory_controller."""

    stopped_velocity_tolerance: Tolerance = Field(
        default=0.01, description="Velocity of each joint at the end [rad/s or m/s]; 0: not checked."
    )
    goal_time: Tolerance = Field(
        default=0.0, description="How long after the last point the goal may be reached [s]; 0: without limit."
    )
    trajectory: dict[str, Tolerance] = Field(
        default={}, description="Position error during the motion, by joint [rad or m]; 0: not checked."
    )
    goal: dict[str, Tolerance] = Field(
        default={}, description="Position error at the end, by joint [rad or m]; 0: not checked."
    )


class Gripper(Parameters):
    """An action that moves one joint of a gripper, with the parameters of ros2_controllers."""

    joint: str = Field(description="The joint.")
    type: Literal["GripperCommand", "ParallelGripperCommand"] = Field(
        default="GripperCommand", description="Type of the action: `GripperCommand` or `ParallelGripperCommand`."
    )
    action: str = Field(default="", description="Name of the action; empty: `<gripper>/gripper_cmd`.")
    goal_tolerance: Tolerance = Field(default=0.01, description="Position error at which a goal is reached [m or rad].")
    stall_velocity_threshold: Tolerance = Field(
        default=0.001, description="The joint is stalled if it is not faster than this [m/s or rad/s]."
    )
    stall_timeout: Tolerance = Field(
        default=1.0, description="Simulated time after which a goal of a stalled joint ends [s]."
    )
    allow_stalling: bool = Field(default=False, description="Whether a goal that ends because of a stall succeeds.")


class JointCommandsParameters(Parameters):
    """Parameters of JointCommands."""

    joints: Joints = Field(default=(), description="Joints to command; empty: all joints with an actuator.")
    topic: str = Field(default="joint_commands", description="Topic of the JointState commands.")
    trajectory_topic: str = Field(default="joint_trajectory", description="Topic of the JointTrajectory commands.")
    trajectory_action: str = Field(
        default="follow_joint_trajectory", description="Name of the FollowJointTrajectory action."
    )
    constraints: Constraints | None = Field(
        default=None, description="Tolerances of FollowJointTrajectory where a goal contains none."
    )
    grippers: dict[str, Gripper] = Field(
        default={}, description="Actions for grippers: `joint`, `type` and so on of each, by name."
    )
    groups: dict[str, Group] = Field(
        default={}, description="Float64MultiArray topics: `joints`, `interface` and `topic` of each group, by name."
    )
    command_interfaces: dict[str, Interfaces] = Field(
        default={},
        description="Contents of JointState commands for a joint: `position`, `velocity`, `effort`, or a list.",
    )
    pid_gains: PidGainsByMode | None = Field(
        default=None, description="PID gains: `position.<name>` and `velocity.<name>`, by joint or actuator."
    )
    actuators: dict[str, Annotated[tuple[str, ...], OneOrMore]] = Field(
        default={}, description="Actuators of joints that the model does not define: a name or a list for each joint."
    )
    mimic: dict[str, Mimic] = Field(
        default={}, description="Joints that follow another joint: `joint`, `multiplier` and `offset` of each, by name."
    )
    transmissions: dict[str, TransmissionParameters] = Field(
        default={}, description="Transmissions of ros2_control, by name."
    )
    clamp: bool = Field(default=True, description="Whether controls are limited to the ranges of the actuators.")
    command_timeout: float = Field(
        default=0.0,
        ge=0,
        le=1e9,
        description="Simulated time after which velocity and effort commands become zero [s]; 0: never.",
    )
    hold_at_start: bool = Field(
        default=False, description="Whether joints with position gains hold their pose until the first command."
    )
    interpolate_from_desired_state: bool = Field(
        default=False,
        description="Whether a trajectory starts at the last commanded position, not at the current position.",
    )
