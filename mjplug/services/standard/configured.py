"""Converts the setting `simulation_interfaces` to entities and named poses."""

from collections.abc import Mapping

import mujoco
import numpy as np

from mjplug.config.standard_settings import NamedPoseSettings, StandardSettings
from mjplug.services.standard.bounds import EMPTY, box
from mjplug.services.standard.entities import CATEGORIES, Named
from mjplug.services.standard.named_poses import Place
from mjplug_schemas.geometry_msgs import Vector3
from mjplug_schemas.simulation_interfaces import Bounds, EntityCategory, EntityInfo


def entities_of(settings: StandardSettings) -> Mapping[str, Named]:
    """Returns the configured entities by name."""
    found = {}
    for name, entry in settings.entities.items():
        category = CATEGORIES[entry.category] if entry.category is not None else 0
        info = EntityInfo(category=EntityCategory(category=category), description=entry.description, tags=entry.tags)
        found[name] = Named(entry.body or name, info, entry.category is not None)
    return found


def places_of(settings: StandardSettings) -> Mapping[str, Place]:
    """Returns the configured poses by name."""
    return {name: _place(entry) for name, entry in settings.named_poses.items()}


def _place(entry: NamedPoseSettings) -> Place:
    x, y, z, w = entry.orientation
    quat = np.array((w, x, y, z))
    mujoco.mju_normalize4(quat)
    return Place(entry.site, np.array(entry.position), quat, entry.description, entry.tags, _bounds(entry))


def _bounds(entry: NamedPoseSettings) -> Bounds:
    if entry.bounds is None:
        return EMPTY
    if entry.bounds.sphere is not None:
        return Bounds(type=Bounds.TYPE_SPHERE, points=(Vector3(), Vector3(x=entry.bounds.sphere)))
    points = np.array(entry.bounds.box)
    return box(points.min(axis=0), points.max(axis=0))
