"""Parameters of Transforms and of each additional frame."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from mjplug.plugin import OneOrMore, Parameters

Names = Annotated[tuple[str, ...], OneOrMore]
Numbers = Annotated[tuple[float, float, float], Field(strict=False)]


class FrameParameters(Parameters):
    """Parameters of an additional frame, under its name; it is fixed to one of `body`, `site` and `camera`."""

    body: str | None = Field(default=None, description="Body that the frame is fixed to.")
    site: str | None = Field(default=None, description="Site that the frame is fixed to.")
    camera: str | None = Field(default=None, description="Camera; the frame is fixed to its optical frame.")
    xyz: Numbers = Field(default=(0.0, 0.0, 0.0), description="Position relative to the body, site or camera [m].")
    rpy: Numbers = Field(default=(0.0, 0.0, 0.0), description="Orientation: roll, pitch and yaw, as in a URDF [rad].")

    @model_validator(mode="after")
    def _fixed_to_one(self) -> Self:
        given = [name for name in ("body", "site", "camera") if getattr(self, name) is not None]
        if len(given) != 1:
            what = " and ".join(given) if given else "none of them"
            raise ValueError(f"set exactly one of body, site and camera; set: {what}")
        return self


class TransformsParameters(Parameters):
    """Parameters of Transforms."""

    rate: float = Field(default=50.0, gt=0, description="Messages per second of simulated time on `topic` [Hz].")
    world_frame: str = Field(
        default="world",
        min_length=1,
        description="Name of the world frame; with a leading `/` it gets no `frame_prefix`.",
    )
    bodies: Names = Field(default=(), description="Bodies to publish; empty: all bodies with a name.")
    exclude: Names = Field(default=(), description="Bodies that are not published.")
    roots: Names = Field(
        default=(),
        description="Bodies whose parent another publisher defines, such as a base of Odometry with `publish_tf`.",
    )
    cameras: bool = Field(default=True, description="Whether the frames of cameras, `<camera>_frame`, are published.")
    sites: Literal["sensors", "all", "none"] | Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default="sensors",
        description="Sites to publish: `sensors` (sites that sensors use), `all`, `none`, or a list of names.",
    )
    frames: dict[str, FrameParameters] = Field(default={}, description="Additional frames, by name.")
    topic: str = Field(default="{ns}/tf", description="Topic of the transforms that move.")
    static_topic: str = Field(default="{ns}/tf_static", description="Topic of the transforms that do not move.")
