"""Parameters of the plugin and of each lidar."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, ValidationInfo, field_validator

from mjplug.plugin import NestedParameters, OneOrMore, Parameters, Priority

_HALF_TURN = 3.1416
"""π, rounded up because angles in files are rounded [rad]."""

Angle = Annotated[float, Field(ge=-_HALF_TURN, le=_HALF_TURN)]

Count = Annotated[int, Field(ge=1)]

Flag = Literal[0, 1]


class LidarParameters(Parameters):
    """Parameters of one lidar, under its name; a missing parameter has the value from the model."""

    site: str | None = Field(
        default=None, description="Site of the lidar; required for a lidar that is not in the model."
    )
    frame_name: str | None = Field(default=None, description="Frame of the messages; default: the name of the site.")
    topic: str | None = Field(
        default=None, description="Topic name; default: `{ns}/scan`, or `{ns}/points` with several rows."
    )
    resolution: Annotated[tuple[Count, ...], Field(min_length=1, max_length=2), OneOrMore] | None = Field(
        default=None, description="Columns and rows of rays; one number is that of the columns of a single row."
    )
    azimuth_range: Annotated[tuple[Angle, Angle], Field(strict=False)] | None = Field(
        default=None, description="Angle of the first and the last column, from the x axis towards y [rad]."
    )
    elevation_range: Annotated[tuple[Angle, ...], Field(min_length=1, max_length=2), OneOrMore] | None = Field(
        default=None, description="Angle of the lowest and the highest row; one angle for a single row [rad]."
    )
    endpoint: bool = Field(default=True, description="Whether the last column is at the end of azimuth_range.")
    min_range: float | None = Field(default=None, ge=0, description="Shortest distance that can be measured [m].")
    max_range: float | None = Field(default=None, gt=0, description="Longest distance that can be measured [m].")
    update_rate: float | None = Field(
        default=None, ge=0, description="Scans per second of simulated time; 0: one scan at every step [Hz]."
    )
    geomgroup: (
        Literal["all", "colliding"] | Annotated[tuple[Flag, Flag, Flag, Flag, Flag, Flag], Field(strict=False)]
    ) = Field(default="all", description="Geom groups that the rays hit.")
    exclude_body: Annotated[tuple[str, ...], OneOrMore] | None = Field(
        default=None, description="Bodies that the rays pass through; default: the body of the site."
    )
    noise_std: float = Field(
        default=0.0, ge=0, description="Standard deviation of the Gaussian noise of the distances [m]."
    )
    dropout: float = Field(default=0.0, ge=0, le=1, description="Probability that a ray has no return.")
    no_return: Literal["rep117"] | Annotated[float, Field(allow_inf_nan=True)] = Field(
        default="rep117", description="Value in a LaserScan for a ray without a distance [m]; `rep117`: inf or -inf."
    )

    @field_validator("resolution")
    @classmethod
    def _with_rows(cls, resolution: tuple[int, ...] | None) -> tuple[int, ...] | None:
        return (*resolution, 1) if resolution is not None and len(resolution) == 1 else resolution

    @field_validator("azimuth_range", "elevation_range")
    @classmethod
    def _in_order(cls, angles: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if angles is not None and len(angles) == 2 and angles[0] >= angles[1]:
            raise ValueError(f"the first angle ({angles[0]:g}) must be below the second ({angles[1]:g})")
        return angles

    @field_validator("max_range")
    @classmethod
    def _above_min_range(cls, max_range: float | None, info: ValidationInfo) -> float | None:
        low = info.data.get("min_range")
        if max_range is not None and low is not None and max_range <= low:
            raise ValueError(f"max_range ({max_range:g}) must be above min_range ({low:g})")
        return max_range


class PluginParameters(Parameters):
    """Parameters of Lidar; every other key is the name of a lidar and contains LidarParameters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[LidarParameters, NestedParameters]]

    threads: int = Field(default=1, ge=1, le=64, description="Threads that cast the rays of a scan.")
    sync: bool = Field(default=False, description="Whether physics waits for each scan.")
    priority: Priority = Field(
        default="low",
        description="Processor time for casting compared with other programs: `idle`: only unused time, `low`: less, "
        "`normal`: the same.",
    )
    job_timeout: float = Field(
        default=60.0,
        gt=0,
        description="Longest time for casting before the worker process is restarted [s]; time in which it waits for a "
        "processor does not count.",
    )
