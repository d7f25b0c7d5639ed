"""What one lidar is to do, complete: the model's word, and the configuration's above it."""

from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName
from mjplug.plugin.bundled import LidarSensor
from mjplug_plugins.lidar.parameters import LidarParameters

DEFAULT_RATE = 10.0
"""Scans per second of a lidar that the model does not have [Hz]."""

DEFAULT_MODEL_RATE = 1.0
"""Scans per second of a lidar of the model that does not say [Hz]; so has mujoco_ros2_control."""

MOST_RAYS = 5_000_000
"""More are a mistake, or a message that nobody can carry."""

_REQUIRED = ("site", "resolution", "azimuth_range", "elevation_range", "max_range")


@dataclass(frozen=True, slots=True)
class Settings:
    """One lidar.

    Attributes:
        name: Its name.
        site: The id of its site.
        frame_name: The frame of its messages.
        topic: Its topic.
        columns: How many rays side by side.
        rows: How many rays one above the other.
        azimuth_range: The first and the last azimuth [rad].
        elevation_range: The lowest and the highest elevation [rad]; the same with one row.
        endpoint: Whether there is a column at the last azimuth.
        min_range: The shortest distance [m].
        max_range: The longest distance [m].
        update_rate: Scans per second; 0 is every step [Hz].
        hidden: For each geom, whether the rays pass through it.
        noise_std: Standard deviation of the distances [m].
        dropout: Probability that a ray gets no answer.
        no_return: What a scan has for such a ray; None is what REP 117 says.
        seed: Where the noise starts from.
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
    """Puts together what the model and the configuration say.

    Args:
        model: The model.
        name: The lidar's name.
        sensor: What the model says of it; None if nothing.
        given: What the configuration says.
        seed: Where the noise starts from.

    Raises:
        PluginError: They do not fit together, or something is missing.
        UnknownName: There is no such site or body.
    """
    said = {} if sensor is None else sensor.attributes
    modelled = LidarParameters.model_validate({key: value for key, value in said.items() if key != "async"})
    parameters = modelled.model_copy(update=given.model_dump(exclude_unset=True))
    missing = [key for key in _REQUIRED if getattr(parameters, key) is None and not (sensor and key == "site")]
    if missing:
        raise PluginError(f"lidar {name!r} has no {', '.join(missing)}")
    resolution, azimuths, elevations = parameters.resolution, parameters.azimuth_range, parameters.elevation_range
    max_range = parameters.max_range
    assert resolution is not None
    assert azimuths is not None
    assert elevations is not None
    assert max_range is not None
    min_range = parameters.min_range or 0.0
    if max_range <= min_range:
        raise PluginError(f"lidar {name!r}: max_range is {max_range:g}, not above min_range, which is {min_range:g}")
    columns, rows = resolution
    if rows > 1 and len(elevations) == 1:
        raise PluginError(f"lidar {name!r}: {rows} rows need two angles in elevation_range, not only {elevations[0]:g}")
    if columns * rows > MOST_RAYS:
        raise PluginError(f"lidar {name!r}: {columns} x {rows} rays are more than {MOST_RAYS}")
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
        # The world is no housing: a lidar on a wall sees the walls.
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
