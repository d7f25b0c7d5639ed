"""Parameters of the plugin and of each camera."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from mjplug.plugin import NestedParameters, OneOrMore, Parameters, Priority
from mjplug_plugins.camera.view import Segmentation

Policy = Literal["streaming", "polled", "disabled"]
Quality = Literal["fast", "full"]
Background = Literal["inf", "nan", "far", "zero"]

Group = Annotated[int, Field(ge=0, le=5)]

Groups = Annotated[tuple[Group, ...], OneOrMore]


class ViewParameters(Parameters):
    """Parameters of one camera, under its name."""

    policy: Policy = Field(
        default="streaming",
        description="`streaming`: publish at the rate; `polled`: publish on request; `disabled`: never publish.",
    )
    publish_rate: float | None = Field(
        default=None, gt=0, description="Images per second of simulated time [Hz]; default: `camera_publish_rate`."
    )
    frame_name: str | None = Field(default=None, description="Frame of the messages; default: `<camera>_frame`.")
    info_topic: str | None = Field(default=None, description="Topic of CameraInfo; default: `<camera>/camera_info`.")
    image_topic: str | None = Field(default=None, description="Topic of the colour image; default: `<camera>/color`.")
    depth_topic: str | None = Field(default=None, description="Topic of the depth image; default: `<camera>/depth`.")
    trigger_service_name: str | None = Field(
        default=None, description="Service that requests an image; default: `<camera>/trigger`."
    )
    width: int | None = Field(
        default=None, ge=1, le=16384, description="Width [pixels]; default: the plugin's `width`."
    )
    height: int | None = Field(
        default=None, ge=1, le=16384, description="Height [pixels]; default: the plugin's `height`."
    )
    segmentation: Segmentation = Field(
        default="none", description="Whether `<camera>/segmentation` publishes the geom or body id of each pixel."
    )


class CameraParameters(Parameters):
    """Parameters of Camera; every other key is the name of a camera and contains ViewParameters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[ViewParameters, NestedParameters]]

    camera_publish_rate: float = Field(
        default=5.0, gt=0, description="Images per second of simulated time, for every streaming camera [Hz]."
    )
    width: int | None = Field(
        default=None,
        ge=1,
        le=16384,
        description="Width of the images [pixels]; default: the camera's `resolution` in the model, else the model's "
        "`offwidth`.",
    )
    height: int | None = Field(
        default=None,
        ge=1,
        le=16384,
        description="Height of the images [pixels]; default: the camera's `resolution` in the model, else the model's "
        "`offheight`.",
    )
    quality: Quality = Field(
        default="fast",
        description="`fast`: without shadows, reflections, haze and antialiasing; `full`: as the model specifies.",
    )
    background: Background = Field(
        default="inf", description="Depth of the background; `far`: the distance of the far plane."
    )
    sync: bool = Field(default=False, description="Whether physics waits for each image.")
    priority: Priority = Field(
        default="low",
        description="Processor time for rendering compared with other programs: `idle`: only unused time, `low`: less, "
        "`normal`: the same.",
    )
    job_timeout: float = Field(
        default=60.0,
        gt=0,
        description="Longest time for rendering before the worker process is restarted [s]; time in which it waits for "
        "a processor does not count.",
    )
    trigger_timeout: float = Field(
        default=8.0,
        gt=0,
        description="Longest wall time that a trigger request waits for its image [s]; then it fails with the reason.",
    )
    jpeg_quality: int = Field(default=95, ge=1, le=100, description="Quality of the JPEG images [%].")
    geom_groups: Groups = Field(default=(0, 1, 2), description="Geom groups that are rendered.")
    site_groups: Groups = Field(default=(), description="Site groups that are rendered.")
