"""Selects entities by name, category, tags and volume."""

from collections.abc import Callable, Iterable

import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.simulation import Simulation
from mjplug.services.standard import regex
from mjplug.services.standard.bounds import Volume, corners
from mjplug.services.standard.entities import Entities, Entity
from mjplug_schemas.simulation_interfaces import Bounds, EntityFilters, TagsFilter

_WORLD_AXES = np.eye(3)
_ORIGIN = np.zeros(3)


def tags_match(filter: TagsFilter) -> Callable[[Iterable[str]], bool]:
    """Returns a function that tells whether tags pass a filter.

    Raises:
        RequestError: The mode is unknown.
    """
    wanted = frozenset(filter.tags)
    if filter.filter_mode not in (TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL):
        raise RequestError(f"filter_mode is {filter.filter_mode}; it must be 0 (any) or 1 (all)")
    if not wanted:
        return lambda tags: True
    if filter.filter_mode == TagsFilter.FILTER_MODE_ALL:
        return wanted.issubset
    return lambda tags: not wanted.isdisjoint(tags)


def selected(simulation: Simulation, entities: Entities, filters: EntityFilters) -> list[Entity]:
    """Returns the entities that pass all given filters, sorted by name.

    Raises:
        RequestError: A filter is not valid.
    """
    by_name = regex.search(filters.filter) if filters.filter else None
    by_tags = tags_match(filters.tags)
    categories = {category.category for category in filters.categories}
    volume = None if filters.bounds.type == Bounds.TYPE_EMPTY else Volume(filters.bounds)
    found = []
    for name, entity in entities.all().items():
        if by_name is not None and not by_name(name):
            continue
        info = entities.info(name)
        if (categories and info.category.category not in categories) or not by_tags(info.tags):
            continue
        found.append(entity)
    if volume is None:
        return found
    simulation.kinematics()
    inside = []
    for entity in found:
        box = corners(simulation.model, simulation.data, entity.geoms, _ORIGIN, _WORLD_AXES)
        # What has no finite size, such as a point or an infinite plane, counts by its origin.
        low, high = box if box is not None else (simulation.data.xpos[entity.body],) * 2
        if volume.overlaps(low, high):
            inside.append(entity)
    return inside
