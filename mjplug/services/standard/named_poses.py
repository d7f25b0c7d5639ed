"""Poses that the configuration names."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import UnknownName
from mjplug.physics.simulation import Simulation
from mjplug.services.standard.entity_states import pose_of
from mjplug.services.standard.filters import tags_match
from mjplug.services.standard.replies import NOT_FOUND, ResultError
from mjplug_schemas.simulation_interfaces import Bounds, NamedPose, TagsFilter

_SITE = mujoco.mjtObj.mjOBJ_SITE


@dataclass(frozen=True, slots=True)
class Place:
    """A named pose.

    Attributes:
        site: The site whose pose it is; empty if it is fixed in the world.
        position: Position in the world [m], without a site.
        quat_wxyz: Orientation in the world, without a site.
        description: Text for users.
        tags: Its tags.
        bounds: Its volume in its own frame.
    """

    site: str
    position: NDArray[np.float64]
    quat_wxyz: NDArray[np.float64]
    description: str
    tags: tuple[str, ...]
    bounds: Bounds


class NamedPoses:
    """The named poses. Physics thread only.

    Args:
        simulation: The model and its state.
        places: The poses by name.
    """

    def __init__(self, simulation: Simulation, places: Mapping[str, Place]) -> None:
        self._simulation = simulation
        self._places = dict(places)

    def poses(self, filter: TagsFilter) -> list[NamedPose]:
        """Returns the poses that pass a filter, sorted by name; a pose on a deleted site is left out."""
        matches = tags_match(filter)
        found = []
        for name in sorted(self._places):
            place = self._places[name]
            where = self._where(place) if matches(place.tags) else None
            if where is not None:
                found.append(NamedPose(name=name, description=place.description, tags=place.tags, pose=pose_of(*where)))
        return found

    def bounds(self, name: str) -> Bounds:
        """Returns the volume of a pose.

        Raises:
            ResultError: There is no such pose.
        """
        if name not in self._places:
            raise ResultError(NOT_FOUND, str(UnknownName("named pose", name, self._places)))
        return self._places[name].bounds

    def _where(self, place: Place) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        if not place.site:
            return place.position, place.quat_wxyz
        simulation = self._simulation
        site = mujoco.mj_name2id(simulation.model, _SITE, place.site)
        if site < 0:
            return None
        simulation.kinematics()
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, simulation.data.site_xmat[site])
        return simulation.data.site_xpos[site], quat
