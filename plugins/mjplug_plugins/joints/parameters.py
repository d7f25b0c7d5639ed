"""What can be configured about joint commands."""

from math import isnan
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from mjplug.plugin import Parameters
from mjplug_plugins.joints.scalar_joint import each_once

Interface = Literal["position", "velocity", "effort"]

Limit = Annotated[float, Field(allow_inf_nan=True)]


def _one_or_more(value: object) -> object:
    return (value,) if isinstance(value, str) else value


Interfaces = Annotated[tuple[Interface, ...], BeforeValidator(_one_or_more), Field(strict=False)]
Joints = Annotated[tuple[str, ...], AfterValidator(each_once), Field(strict=False)]


class PidGains(Parameters):
    """The gains of one PID, under control_toolbox's names."""

    p: float = Field(default=0.0, description="Proportional gain.")
    i: float = Field(default=0.0, description="Integral gain.")
    d: float = Field(default=0.0, description="Derivative gain.")
    u_clamp_max: Limit = Field(default=float("inf"), description="Upper limit of the output.")
    u_clamp_min: Limit = Field(default=float("-inf"), description="Lower limit of the output.")
    i_clamp_max: Limit = Field(default=float("inf"), description="Upper limit of the integral's part.")
    i_clamp_min: Limit = Field(default=float("-inf"), description="Lower limit of the integral's part.")
    antiwindup_strategy: Literal["none", "legacy", "back_calculation", "conditional_integration"] = Field(
        default="none", description="What the integral does while the output is at its limit."
    )
    tracking_time_constant: float = Field(
        default=0.0, ge=0, description="Of `back_calculation` [s]; 0 is sqrt(d / i), or p / i without d."
    )
    error_deadband: float = Field(default=0.0, ge=0, description="Errors up to which nothing is integrated.")
    antiwindup: bool = Field(default=False, description="Of older control_toolbox; the integral is always limited.")
    saturation: bool = Field(default=True, description="Of older control_toolbox; the output is always limited.")
    save_i_term: bool = Field(default=False, description="Of control_toolbox; the integral starts at zero anyway.")

    @field_validator("u_clamp_min", "i_clamp_min")
    @classmethod
    def _below_the_upper(cls, low: float, info: ValidationInfo) -> float:
        upper = str(info.field_name).replace("min", "max")
        if not low <= info.data.get(upper, float("inf")):
            raise ValueError(f"{low:g} is not below {upper}, which is {info.data[upper]:g}")
        return low

    @field_validator("u_clamp_max", "i_clamp_max")
    @classmethod
    def _is_a_number(cls, high: float) -> float:
        if isnan(high):
            raise ValueError("a limit cannot be NaN")
        return high


class PidGainsByMode(Parameters):
    """The gains of the joints, for each kind of command that a PID is to follow."""

    position: dict[str, PidGains] = Field(default={}, description="By name of the joint or actuator.")
    velocity: dict[str, PidGains] = Field(default={}, description="By name of the joint or actuator.")


class Group(Parameters):
    """Joints that one topic of plain numbers commands."""

    joints: Joints = Field(min_length=1, description="The joints, in the order of the numbers.")
    interface: Interface = Field(default="position", description="What the numbers are.")
    topic: str = Field(default="", description="Topic name; empty is `<group>/commands`.")


class Mimic(Parameters):
    """How a joint follows another one: multiplier · its command + offset."""

    joint: str = Field(description="The joint that it follows.")
    multiplier: float = Field(default=1.0, description="Factor of all its commands.")
    offset: float = Field(default=0.0, description="Added to positions [rad or m].")


class JointCommandsParameters(Parameters):
    """Parameters of JointCommands."""

    joints: Joints = Field(default=(), description="Joints to command; empty means all that have an actuator.")
    topic: str = Field(default="joint_commands", description="Topic of the JointState commands.")
    trajectory_topic: str = Field(default="joint_trajectory", description="Topic of the JointTrajectory commands.")
    groups: dict[str, Group] = Field(
        default={}, description="Topics of plain numbers: `joints`, `interface` and `topic` of each group, by name."
    )
    command_interfaces: dict[str, Interfaces] = Field(
        default={}, description="What JointState commands have of a joint: `position`, `velocity`, `effort`, or a list."
    )
    pid_gains: PidGainsByMode | None = Field(
        default=None, description="Gains, as `position.<name>` and `velocity.<name>`, by joint or actuator."
    )
    actuators: dict[str, Annotated[tuple[str, ...], BeforeValidator(_one_or_more), Field(strict=False)]] = Field(
        default={}, description="Actuators of a joint where the model does not say it: a name or a list for each joint."
    )
    mimic: dict[str, Mimic] = Field(
        default={}, description="Joints that follow another: `joint`, `multiplier` and `offset` of each, by name."
    )
    clamp: bool = Field(default=True, description="Whether controls are kept within the ranges of the actuators.")
    command_timeout: float = Field(
        default=0.0,
        ge=0,
        le=1e9,
        description="Age at which velocity and effort commands become zero, in simulated time [s]; 0 is never.",
    )
    hold_at_start: bool = Field(
        default=False, description="Whether joints with position gains hold their pose until the first command."
    )
    interpolate_from_desired_state: bool = Field(
        default=False, description="Whether a trajectory starts where the joint was told to be, not where it is."
    )
