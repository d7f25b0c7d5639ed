"""What can be set about cameras."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from mjplug.plugin import NestedParameters, Parameters, Priority
from mjplug_plugins.camera.view import Segmentation

Policy = Literal["streaming", "polled", "disabled"]
Quality = Literal["fast", "full"]
Background = Literal["inf", "nan", "far", "zero"]

Group = Annotated[int, Field(ge=0, le=5)]


class ViewParameters(Parameters):
    """Parameters of one camera, under its name."""

    policy: Policy = Field(default="streaming", description="When it publishes: at its rate, on request, or never.")
    publish_rate: float | None = Field(
        default=None, gt=0, description="Images per second of simulated time [Hz]; none is `camera_publish_rate`."
    )
    frame_name: str | None = Field(default=None, description="Frame of its messages; none is `<camera>_frame`.")
    info_topic: str | None = Field(default=None, description="Topic of CameraInfo; none is `<camera>/camera_info`.")
    image_topic: str | None = Field(default=None, description="Topic of the colour image; none is `<camera>/color`.")
    depth_topic: str | None = Field(default=None, description="Topic of the depth image; none is `<camera>/depth`.")
    trigger_service_name: str | None = Field(
        default=None, description="Service that asks for an image; none is `<camera>/trigger`."
    )
    width: int | None = Field(default=None, ge=1, le=16384, description="Columns; none is the plugin's `width`.")
    height: int | None = Field(default=None, ge=1, le=16384, description="Rows; none is the plugin's `height`.")
    segmentation: Segmentation = Field(
        default="none", description="Whether pixels numbered by geom or body are offered on `<camera>/segmentation`."
    )


class CameraParameters(Parameters):
    """Parameters of Camera; every other name is that of a camera, with ViewParameters below it."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[ViewParameters, NestedParameters]]

    camera_publish_rate: float = Field(
        default=5.0, gt=0, description="Images per second of simulated time, of every streaming camera [Hz]."
    )
    width: int | None = Field(
        default=None,
        ge=1,
        le=16384,
        description="Columns of the images; none is the camera's `resolution` in the model, or else the model's "
        "`offwidth` [pixels].",
    )
    height: int | None = Field(
        default=None,
        ge=1,
        le=16384,
        description="Rows of the images; none is the camera's `resolution` in the model, or else the model's "
        "`offheight` [pixels].",
    )
    quality: Quality = Field(
        default="fast",
        description="`fast` leaves out shadows, reflections, haze, smooth edges; `full` draws what the model asks for.",
    )
    background: Background = Field(
        default="inf", description="Depth where there is nothing; `far` is the distance of the far plane."
    )
    sync: bool = Field(default=False, description="Whether physics waits for every image.")
    priority: Priority = Field(
        default="low",
        description="Processor time for drawing beside other programs: `idle` only what is left over, `low` less than "
        "others, `normal` as much as others.",
    )
    job_timeout: float = Field(
        default=60.0,
        gt=0,
        description="How long drawing may take before its process is replaced [s]; waiting for a processor does not "
        "count.",
    )
    trigger_timeout: float = Field(
        default=8.0, gt=0, description="After how long without an image a trigger is refused, with the reason [s]."
    )
    jpeg_quality: int = Field(default=95, ge=1, le=100, description="Quality of the JPEG images [%].")
    geom_groups: tuple[Group, ...] = Field(
        default=(0, 1, 2), strict=False, description="Groups of geoms that are drawn."
    )
    site_groups: tuple[Group, ...] = Field(default=(), strict=False, description="Groups of sites that are drawn.")
