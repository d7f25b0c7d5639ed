"""The options of a conversion: those of `mjplug convert`, and `model_options` in a configuration."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

MIN_THRESHOLD, MAX_THRESHOLD = 0.01, 1.0
"""Thresholds of decompositions. CoACD takes very long with smaller ones."""


def _collision(text: str) -> str:
    if text in ("urdf", "visual") or (text.startswith("visual:") and all(text[7:].split(","))):
        return text
    raise ValueError("must be urdf, visual, or visual:LINK,LINK")


def _decompose(text: str) -> str:
    if text in ("none", "auto", "all"):
        return text
    for part in text.split(","):
        link, equals, number = part.partition("=")
        try:
            valid = bool(link and equals) and MIN_THRESHOLD <= float(number) <= MAX_THRESHOLD
        except ValueError:
            valid = False
        if not valid:
            raise ValueError("must be none, auto, all, or LINK=THRESHOLD,... with thresholds from 0.01 to 1")
    return text


def _as_text(value: Any) -> Any:
    """Accepts numbers and booleans of YAML as values of xacro arguments."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) if isinstance(value, int | float) else value


XacroValue = Annotated[str, BeforeValidator(_as_text)]


class ConversionOptions(BaseModel):
    """Options of the conversion of a URDF or xacro file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    raw: bool = Field(
        False, description="Whether MuJoCo reads the URDF itself, without a conversion; the other options are not used."
    )
    arguments: dict[str, XacroValue] = Field({}, description="Values of xacro arguments.")
    packages: dict[str, str] = Field({}, description="Folders of ROS packages by name.")
    base: Literal["auto", "fixed", "free"] = Field("auto", description="Whether the robot is fixed to the world.")
    actuators: Literal["auto", "position", "velocity", "motor", "none"] = Field(
        "auto",
        description="Kind of actuators; `auto`: as ros2_control or transmissions say, else by the kind of joint.",
    )
    collision: Annotated[str, AfterValidator(_collision)] = Field(
        "urdf", description="Collision geometry: `urdf`, or `visual` (`visual:LINK,LINK` for some links)."
    )
    decompose: Annotated[str, AfterValidator(_decompose)] = Field(
        "none",
        description="Division of collision meshes into convex parts: `none`, `auto` (concave ones), `all`, or "
        "`LINK=THRESHOLD,...`.",
    )
    self_collision: Literal["auto", "all", "none"] = Field(
        "auto", description="Collisions between links; `auto`: not between links that always touch."
    )
    srdf: str = Field("", description="An SRDF of MoveIt: disabled collisions, and the group state `home`.")
    gravcomp: Literal["auto", "on", "off"] = Field(
        "auto", description="Gravity compensation by the servos; `auto`: for robots that are fixed to the world."
    )
    scene: str = Field(
        "",
        description="Scene: `floor`, `tabletop`, `obstacles`, `none`, or an MJCF file; also for MJCF models. Empty: "
        "that of `<mujoco_inputs>`, else `floor`; MJCF models are simulated as they are.",
    )
    mujoco_inputs: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="Files with `<mujoco_inputs>` of mujoco_ros2_control."
    )
    fuse: bool = Field(False, description="Whether links behind fixed joints are merged into their parents.")
    sites: bool = Field(False, description="Whether each link gets a site of its name.")
    up_axis: Literal["ignore", "apply"] = Field(
        "ignore", description="Whether COLLADA meshes with `Y_UP` are turned; RViz ignores it."
    )
    max_faces: int = Field(20_000, ge=0, description="Simplify visual meshes with more triangles; 0: never.")
    strict: bool = Field(False, description="Whether a missing mesh stops the conversion.")
