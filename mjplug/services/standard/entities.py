"""The entities of a simulation: each child body of the world with its subtree, and what clients know about it."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import UnknownName
from mjplug.near_names import Names
from mjplug.physics.simulation import Simulation
from mjplug.services.standard.replies import NOT_FOUND, ResultError
from mjplug_schemas.simulation_interfaces import EntityCategory, EntityInfo

_BODY = mujoco.mjtObj.mjOBJ_BODY
_STATIC, _ROBOT, _DYNAMIC = (
    EntityCategory.CATEGORY_STATIC_OBJECT,
    EntityCategory.CATEGORY_ROBOT,
    EntityCategory.CATEGORY_DYNAMIC_OBJECT,
)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)

CATEGORIES: Mapping[str, int] = {
    "object": EntityCategory.CATEGORY_OBJECT,
    "robot": EntityCategory.CATEGORY_ROBOT,
    "human": EntityCategory.CATEGORY_HUMAN,
    "dynamic_object": EntityCategory.CATEGORY_DYNAMIC_OBJECT,
    "static_object": EntityCategory.CATEGORY_STATIC_OBJECT,
}
"""The categories by their names in a configuration."""


@dataclass(frozen=True, slots=True)
class Entity:
    """An entity.

    Attributes:
        name: Its name.
        body: Id of its canonical link, a child of the world.
        bodies: Ids of all its bodies.
        geoms: Ids of all its geoms, shape (n,).
        free: Id of the free joint of the canonical link; -1 if it has none.
        mocap: Mocap id of the canonical link; -1 if it is no mocap body.
        info: Category, description and tags.
    """

    name: str
    body: int
    bodies: tuple[int, ...]
    geoms: NDArray[np.int64]
    free: int
    mocap: int
    info: EntityInfo


@dataclass(frozen=True, slots=True)
class Named:
    """An entity of the configuration; see the setting `simulation_interfaces.entities`."""

    body: str
    info: EntityInfo
    has_category: bool


class Entities:
    """All entities. They are found again when the model has changed. Physics thread only.

    Args:
        simulation: The model and its state.
        named: The entities of the configuration, by name.
    """

    def __init__(self, simulation: Simulation, named: Mapping[str, Named]) -> None:
        self._simulation = simulation
        self._named = dict(named)
        self._changed: dict[str, EntityInfo] = {}
        self._model: mujoco.MjModel | None = None
        self._entities: dict[str, Entity] = {}
        self._names = Names(())

    def all(self) -> Mapping[str, Entity]:
        """Returns the entities by name, sorted by name."""
        if self._model is not self._simulation.model:
            self._find()
        return self._entities

    def get(self, name: str) -> Entity:
        """Returns an entity.

        Raises:
            ResultError: There is no such entity.
        """
        entities = self.all()
        if name not in entities:
            raise ResultError(NOT_FOUND, str(UnknownName("entity", name, self._names)))
        return entities[name]

    def info(self, name: str) -> EntityInfo:
        """Returns category, description and tags of an entity.

        Raises:
            ResultError: There is no such entity.
        """
        entity = self.get(name)
        return self._changed.get(name, entity.info)

    def set_info(self, name: str, info: EntityInfo) -> None:
        """Replaces category, description and tags of an entity until `forget`.

        Raises:
            ResultError: There is no such entity.
        """
        self.get(name)
        self._changed[name] = info

    def forget(self) -> None:
        """Undoes all calls of `set_info`."""
        self._changed.clear()

    def _find(self) -> None:
        model = self._simulation.model
        driven = _driven_bodies(model)
        by_body = {named.body: (name, named) for name, named in self._named.items()}
        found: dict[str, list[int]] = {}
        configured: dict[str, Named] = {}
        for body in np.flatnonzero(model.body_parentid == 0).tolist():
            if not body:
                continue
            body_name = mujoco.mj_id2name(model, _BODY, body) or f"body_{body}"
            name, named = by_body.get(body_name, (self._simulation.spawned_owner(body_name), None))
            if named is not None:
                configured[name] = named
            found.setdefault(name, []).append(body)
        entities = {}
        for name in sorted(found):
            roots = found[name]
            bodies = tuple(np.flatnonzero(np.isin(model.body_rootid, roots)).tolist())
            unnamed = not mujoco.mj_id2name(model, _BODY, roots[0])
            entities[name] = _entity(model, name, roots[0], bodies, driven, configured.get(name), unnamed)
        self._entities, self._model = entities, model
        self._names = Names(entities)
        self._changed = {name: info for name, info in self._changed.items() if name in entities}


def _entity(
    model: mujoco.MjModel,
    name: str,
    body: int,
    bodies: tuple[int, ...],
    driven: frozenset[int],
    named: Named | None,
    unnamed: bool,
) -> Entity:
    ids = list(bodies)
    free = -1
    for joint in range(int(model.body_jntadr[body]), int(model.body_jntadr[body]) + int(model.body_jntnum[body])):
        if int(model.jnt_type[joint]) == _FREE:
            free = joint
    category = _DYNAMIC if model.body_dofnum[ids].any() else _STATIC
    if not driven.isdisjoint(bodies):
        category = _ROBOT
    description = "this body has no name, so the name of the entity may change with the model" if unnamed else ""
    info = EntityInfo(category=EntityCategory(category=category), description=description)
    if named is not None:
        info = named.info if named.has_category else named.info.model_copy(update={"category": info.category})
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, ids))
    return Entity(name, body, bodies, geoms, free, int(model.body_mocapid[body]), info)


def _driven_bodies(model: mujoco.MjModel) -> frozenset[int]:
    """Returns the bodies that an actuator acts on."""
    transmission = mujoco.mjtTrn
    driven: set[int] = set()
    for kind, (target, second) in zip(model.actuator_trntype.tolist(), model.actuator_trnid.tolist(), strict=True):
        if kind in (transmission.mjTRN_JOINT, transmission.mjTRN_JOINTINPARENT):
            driven.add(int(model.jnt_bodyid[target]))
        elif kind in (transmission.mjTRN_SITE, transmission.mjTRN_SLIDERCRANK):
            driven.add(int(model.site_bodyid[target]))
            if second >= 0:
                driven.add(int(model.site_bodyid[second]))
        elif kind == transmission.mjTRN_BODY:
            driven.add(int(target))
        elif kind == transmission.mjTRN_TENDON:
            driven |= _bodies_of_tendon(model, target)
    return frozenset(driven)


def _bodies_of_tendon(model: mujoco.MjModel, tendon: int) -> set[int]:
    begin = int(model.tendon_adr[tendon])
    bodies: set[int] = set()
    for wrap in range(begin, begin + int(model.tendon_num[tendon])):
        kind, target = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == mujoco.mjtWrap.mjWRAP_JOINT:
            bodies.add(int(model.jnt_bodyid[target]))
        elif kind == mujoco.mjtWrap.mjWRAP_SITE:
            bodies.add(int(model.site_bodyid[target]))
    return bodies
