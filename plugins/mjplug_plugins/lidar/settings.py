"""Complete settings of one lidar: the values of the configuration, else those of the model, else defaults."""

from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName
from mjplug.plugin.bundled import LidarSensor
from mjplug_plugins.lidar.parameters import LidarParameters

DEFAULT_RATE = 10.0
"""Scans per second of a lidar that is only configured [Hz]."""

DEFAULT_MODEL_RATE = 1.0
"""Scans per second of a lidar of the model without update_rate [Hz]; the same as in mujoco_ros2_control."""

MAX_RAYS = 5_000_000
"""Largest number of rays of a lidar; more are a mistake or make messages too large to send."""

REQUIRED = ("site", "resolution", "azimuth_range", "elevation_range", "max_range")
"""Parameters that a lidar needs, from the model or from the configuration."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of one lidar.

    Attributes:
        name: Its name.
        site: The id of its site.
        frame_name: The frame of its messages.
        topic: Its topic.
        columns: Number of rays in a row.
        rows: Number of rows.
        azimuth_range: First and last azimuth [rad].
        elevation_range: Lowest and highest elevation [rad]; the same with one row.
        endpoint: Whether the last column is at the last azimuth.
        min_range: Shortest distance that can be measured [m].
        max_range: Longest distance that can be measured [m].
        update_rate: Scans per second of simulated time; 0: at every step [Hz].
        hidden: For each geom, whether the rays pass through it; length ngeom.
        noise_std: Standard deviation of the noise of the distances [m].
        dropout: Probability that a ray has no return.
        no_return: Value in a LaserScan for a ray without a distance [m]; None: inf and -inf, as REP 117 defines.
        seed: Seed of the noise.
    """

    name: str
    site: int
    frame_name: str
    topic: str
    columns: int
    rows: int
    azimuth_range: tuple[float, float]
    elevation_range: tuple[float, float]
    endpoint: bool
    min_range: float
    max_range: float
    update_rate: float
    hidden: tuple[bool, ...]
    noise_std: float
    dropout: float
    no_return: float | None
    seed: tuple[int, ...]


def settings_of(
    model: mujoco.MjModel, name: str, sensor: LidarSensor | None, given: LidarParameters, seed: tuple[int, ...]
) -> Settings:
    """Combines the values of the model and of the configuration.

    Args:
        model: The compiled model.
        name: The lidar's name.
        sensor: The lidar in the model; None if it is only configured.
        given: The parameters in the configuration.
        seed: Seed of the noise.

    Raises:
        PluginError: A parameter is missing or does not fit the others.
        UnknownName: The model has no such site or body.
    """
    attributes = {} if sensor is None else sensor.attributes
    modelled = LidarParameters.model_validate({key: value for key, value in attributes.items() if key != "async"})
    parameters = modelled.model_copy(update=given.model_dump(exclude_unset=True))
    missing = [key for key in REQUIRED if getattr(parameters, key) is None and not (sensor and key == "site")]
    if missing:
        raise PluginError(f"lidar {name!r}: these parameters are missing: {', '.join(missing)}")
    resolution, azimuths, elevations = parameters.resolution, parameters.azimuth_range, parameters.elevation_range
    max_range = parameters.max_range
    assert resolution is not None
    assert azimuths is not None
    assert elevations is not None
    assert max_range is not None
    min_range = parameters.min_range or 0.0
    if max_range <= min_range:
        raise PluginError(f"lidar {name!r}: max_range ({max_range:g}) must be above min_range ({min_range:g})")
    columns, rows = resolution
    if rows > 1 and len(elevations) == 1:
        raise PluginError(
            f"lidar {name!r}: {rows} rows need two angles in elevation_range, not one ({elevations[0]:g})"
        )
    if columns * rows > MAX_RAYS:
        raise PluginError(f"lidar {name!r}: {columns} x {rows} rays; at most {MAX_RAYS} are allowed")
    site = _site(model, parameters.site) if parameters.site is not None or sensor is None else sensor.site
    rate = parameters.update_rate
    if rate is None:
        rate = DEFAULT_RATE if sensor is None else DEFAULT_MODEL_RATE
    return Settings(
        name=name,
        site=site,
        frame_name=parameters.frame_name or mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, site) or name,
        topic=parameters.topic or ("{ns}/points" if rows > 1 else "{ns}/scan"),
        columns=columns,
        rows=rows,
        azimuth_range=azimuths,
        elevation_range=(elevations[0], elevations[-1]),
        endpoint=parameters.endpoint,
        min_range=min_range,
        max_range=max_range,
        update_rate=rate,
        hidden=_hidden(model, site, parameters),
        noise_std=parameters.noise_std,
        dropout=parameters.dropout,
        no_return=None if parameters.no_return == "rep117" else float(parameters.no_return),
        seed=seed,
    )


def _site(model: mujoco.MjModel, name: str | None) -> int:
    return _id(model, mujoco.mjtObj.mjOBJ_SITE, "site", name or "", model.nsite)


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, word: str, name: str, count: int) -> int:
    names = [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]
    if not name or name not in names:
        raise UnknownName(word, name, names)
    return names.index(name)


def _hidden(model: mujoco.MjModel, site: int, parameters: LidarParameters) -> tuple[bool, ...]:
    if parameters.exclude_body is None:
        # The world body is not excluded: a lidar mounted on a wall must see the walls.
        own = int(model.site_bodyid[site])
        bodies = {own} - {0}
    else:
        bodies = {_id(model, mujoco.mjtObj.mjOBJ_BODY, "body", name, model.nbody) for name in parameters.exclude_body}
    groups = model.geom_group.clip(0, mujoco.mjNGROUP - 1).tolist()
    if parameters.geomgroup == "all":
        seen = set(groups)
    elif parameters.geomgroup == "colliding":
        colliding = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)).tolist()
        seen = {group for group, collides in zip(groups, colliding, strict=True) if collides}
    else:
        seen = {group for group, flag in enumerate(parameters.geomgroup) if flag}
    owners = model.geom_bodyid.tolist()
    return tuple(owner in bodies or group not in seen for owner, group in zip(owners, groups, strict=True))
