"""What can be set about frames."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from mjplug.plugin import Parameters

Numbers = Annotated[tuple[float, float, float], Field(strict=False)]


class FrameParameters(Parameters):
    """Parameters of one more frame, under its name; it is fixed to one of `body`, `site` and `camera`."""

    body: str | None = Field(default=None, description="Body that it is fixed to.")
    site: str | None = Field(default=None, description="Site that it is fixed to.")
    camera: str | None = Field(default=None, description="Camera whose optical frame it is fixed to.")
    xyz: Numbers = Field(default=(0.0, 0.0, 0.0), description="Where it is, in the axes of what it is fixed to [m].")
    rpy: Numbers = Field(
        default=(0.0, 0.0, 0.0), description="How it is turned: roll, pitch and yaw, as in a URDF [rad]."
    )

    @model_validator(mode="after")
    def _fixed_to_one(self) -> Self:
        given = [name for name in ("body", "site", "camera") if getattr(self, name) is not None]
        if len(given) != 1:
            what = " and ".join(given) if given else "none"
            raise ValueError(f"a frame is fixed to one of body, site and camera, and {what} is given")
        return self


class TransformsParameters(Parameters):
    """Parameters of Transforms."""

    rate: float = Field(default=50.0, gt=0, description="Messages per second of simulated time on `topic` [Hz].")
    world_frame: str = Field(
        default="world",
        min_length=1,
        description="Name of the world's frame; with a leading `/` it gets no `frame_prefix`.",
    )
    bodies: tuple[str, ...] = Field(
        default=(), strict=False, description="Bodies that are frames; empty means all that have a name."
    )
    exclude: tuple[str, ...] = Field(default=(), strict=False, description="Bodies that are no frames.")
    roots: tuple[str, ...] = Field(
        default=(),
        strict=False,
        description="Bodies that others give a parent, such as the base of an odometry with `publish_tf`.",
    )
    cameras: bool = Field(default=True, description="Whether cameras have frames, `<camera>_frame`.")
    sites: Literal["sensors", "all", "none"] | Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default="sensors",
        description="Sites that are frames: `sensors` is those that sensors name; or a list of names.",
    )
    frames: dict[str, FrameParameters] = Field(default={}, description="More frames, by name.")
    topic: str = Field(default="{ns}/tf", description="Topic of the transforms that move.")
    static_topic: str = Field(default="{ns}/tf_static", description="Topic of the transforms that do not move.")
