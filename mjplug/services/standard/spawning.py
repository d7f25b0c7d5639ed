"""Adds and removes entities."""

import re
from collections.abc import Collection, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjplug.errors import RequestError, quoted
from mjplug.model.library import Library, bundled, text_source
from mjplug.model.recipe import CompositionError, Recipe, Source, Spawned, compose, model_name
from mjplug.physics.frames import Array
from mjplug.physics.scheduler import Wait
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Call, Slow
from mjplug.services.standard.bounds import EMPTY, box, corners
from mjplug.services.standard.entities import Entities
from mjplug.services.standard.entity_states import frame_in_world, pose_in_world
from mjplug.services.standard.replies import FAILED, ResultError, done, failed
from mjplug.services.standard.world_builder import Build, WorldBuilder
from mjplug_schemas.names import normalize_namespace
from mjplug_schemas.simulation_interfaces import (
    Bounds,
    DeleteEntity,
    GetSpawnables,
    Resource,
    Result,
    Spawnable,
    SpawnEntities,
    SpawnEntity,
    SpawnResult,
)

MAX_ENTITIES = 1000
"""Maximum number of entities in a request."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_MAX_NAME = 100
_CODES = {
    "format": SpawnResult.UNSUPPORTED_FORMAT,
    "resource": SpawnResult.NO_RESOURCE,
    "parse": SpawnResult.RESOURCE_PARSE_ERROR,
    "assets": SpawnResult.MISSING_ASSETS,
    "unsupported": SpawnResult.UNSUPPORTED_ASSETS,
}


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A request that was checked as far as the present state allows."""

    name: str
    allow_renaming: bool
    uri: str
    text: str
    position: Array
    quat_wxyz: Array


class Spawning:
    """Handles the services that add and remove entities. Physics thread only.

    Args:
        simulation: The model and its state.
        entities: The entities.
        builder: Changes the model.
        library: The models that clients may add.
    """

    def __init__(self, simulation: Simulation, entities: Entities, builder: WorldBuilder, library: Library) -> None:
        self._simulation = simulation
        self._entities = entities
        self._builder = builder
        self._library = library
        # Boxes around spawnable models, by file and time of the last change. Builder thread.
        self._bounds: dict[tuple[Path, int], Bounds] = {}

    def spawn(self, request: SpawnEntity.Request, call: Call) -> Slow:
        """Handles SpawnEntity."""
        (result,) = yield from self._spawn([request])
        return SpawnEntity.Response(result=result.result, entity_name=result.entity_name)

    def spawn_all(self, request: SpawnEntities.Request, call: Call) -> Slow:
        """Handles SpawnEntities: entities that fail are left out, the others appear together."""
        if len(request.spawn_requests) > MAX_ENTITIES:
            raise RequestError(
                f"{len(request.spawn_requests)} entities are requested; at most {MAX_ENTITIES} are accepted"
            )
        results = yield from self._spawn(request.spawn_requests)
        bad = sum(result.result.result != Result.RESULT_OK for result in results)
        outcome = done()
        if bad:
            code = SpawnEntities.Response.ENTITIES_SPAWN_FAILED
            outcome = Result(result=code, error_message=f"{bad} of {len(results)} entities were not spawned")
        return SpawnEntities.Response(result=outcome, results=tuple(results))

    def delete(self, request: DeleteEntity.Request, call: Call) -> Slow:
        """Handles DeleteEntity."""
        yield from self._delete(request.entity)
        return DeleteEntity.Response(result=done())

    def spawnables(self, request: GetSpawnables.Request, call: Call) -> Slow:
        """Handles GetSpawnables: files below the configured folders and bundled models, with their boxes."""
        library, cache = self._library, self._bounds

        def find() -> list[Spawnable]:
            return [_spawnable(uri, library, cache) for uri in (*map(Path.as_uri, library.files()), *bundled())]

        found = yield from self._builder.run(find)
        note = ""
        if request.sources:
            sources = ", ".join(source[:100] for source in request.sources[:10])
            note = f"these sources are not searched: {sources}"
        return GetSpawnables.Response(result=done(note), spawnables=tuple(found))

    def restore_base(self, deleted_too: bool) -> Generator[Wait, None, None]:
        """Removes all spawned entities; with `deleted_too`, restores the whole base model."""

        def plan(build: Build) -> None:
            deleted = frozenset[int]() if deleted_too else build.before.deleted
            values = () if deleted_too else build.before.values
            build.recipe = replace(build.before, spawned=(), deleted=deleted, values=values)

        if self._builder.changed:
            yield from self._builder.change(plan)

    def _spawn(self, requests: Sequence[Any]) -> Generator[Wait, None, list[SpawnResult]]:
        wanted: dict[int, _Wanted] = {}
        results: dict[int, SpawnResult] = {}
        for index, request in enumerate(requests):
            try:
                wanted[index] = self._check(request)
            except RequestError as error:
                results[index] = SpawnResult(result=failed(error))
        if wanted:

            def plan(build: Build) -> dict[int, SpawnResult]:
                # Entities may have been added since the request was checked.
                return _plan(build, wanted, taken | {entity.name for entity in build.before.spawned}, self._library)

            taken = frozenset(self._entities.all()) | self._body_names()
            results |= yield from self._builder.change(plan)
        return [results[index] for index in range(len(requests))]

    def _check(self, request: Any) -> _Wanted:
        if request.name and not _is_name(request.name):
            raise ResultError(
                SpawnResult.NAME_INVALID,
                f"name is {quoted(request.name)}; a name begins with an English letter and has letters, digits and "
                f"'_', at most {_MAX_NAME}",
            )
        try:
            normalize_namespace(request.entity_namespace)
        except ValueError as error:
            raise ResultError(SpawnResult.NAMESPACE_INVALID, f"entity_namespace: {error}") from None
        resource = request.entity_resource
        if not resource.uri and not resource.resource_string:
            raise ResultError(SpawnResult.NO_RESOURCE, "entity_resource has neither uri nor resource_string")
        stamped = request.initial_pose
        frame = frame_in_world(self._simulation, self._entities, stamped.header.frame_id)
        position, quat = pose_in_world(stamped.pose, *frame, SpawnResult.INVALID_POSE)
        text = "" if resource.uri else resource.resource_string
        return _Wanted(request.name, request.allow_renaming, resource.uri, text, position, quat)

    def _delete(self, name: str) -> Generator[Wait, None, None]:
        entity = self._entities.get(name)
        spawned = name in self._simulation.spawned
        generation = self._simulation.generation
        roots = [body for body in entity.bodies if self._simulation.model.body_parentid[body] == 0]
        builder = self._builder

        def plan(build: Build) -> None:
            recipe = build.before
            if spawned:
                left = tuple(other for other in recipe.spawned if other.name != name)
                build.recipe = replace(recipe, spawned=left)
                return
            base = builder.base_keys()["body"]
            keys = base if build.keys is None else build.keys["body"]
            numbers = frozenset(base.index(keys[root]) for root in roots)
            build.recipe = replace(recipe, deleted=recipe.deleted | numbers)
            build.removed = (name,)

        while builder.busy is not None:
            yield builder.busy
        if self._simulation.generation != generation:
            # Another request has changed the model meanwhile.
            yield from self._delete(name)
            return
        try:
            yield from builder.change(plan)
        except CompositionError as error:
            raise ResultError(FAILED, f"entity {name!r} cannot be removed: {error}") from None

    def _body_names(self) -> frozenset[str]:
        return frozenset(self._simulation.body_names)


def _is_name(name: str) -> bool:
    return bool(_NAME.fullmatch(name)) and len(name) <= _MAX_NAME


def _plan(
    build: Build, wanted: Mapping[int, _Wanted], taken: Collection[str], library: Library
) -> dict[int, SpawnResult]:
    """Adds entities to the recipe of a build, and returns the result of each. Builder thread."""
    used, results, chosen = set(taken), dict[int, SpawnResult](), dict[int, Spawned]()
    for index, request in wanted.items():
        try:
            chosen[index] = entity = _entity(request, used, library)
        except RequestError as error:
            results[index] = SpawnResult(result=failed(error))
        except CompositionError as error:
            results[index] = _refused(error)
        else:
            used.add(entity.name)
    try:
        notes = _try(build, chosen.values())
    except CompositionError as error:
        # At least one of them does not fit; each alone shows which.
        for index, entity in list(chosen.items()):
            try:
                if len(chosen) > 1:
                    _try(build, [entity])
                else:
                    raise error
            except CompositionError as reason:
                results[index] = _refused(reason)
                del chosen[index]
        notes = _try(build, chosen.values()) if chosen else ()
    if chosen:
        build.recipe = _with(build.before, chosen.values())
    for index, entity in chosen.items():
        results[index] = SpawnResult(result=done("; ".join(notes)), entity_name=entity.name)
    return results


def _with(recipe: Recipe, entities: Any) -> Recipe:
    return replace(recipe, spawned=(*recipe.spawned, *entities))


def _try(build: Build, entities: Any) -> tuple[str, ...]:
    return build.compose(_with(build.before, entities)).notes if entities else ()


def _entity(request: _Wanted, used: Collection[str], library: Library) -> Spawned:
    source = text_source(request.text) if request.text else library.find(request.uri)
    name = _free_name(request, source, used)
    x, y, z = request.position.tolist()
    qw, qx, qy, qz = request.quat_wxyz.tolist()
    return Spawned(name, source, (x, y, z), (qw, qx, qy, qz))


def _free_name(request: _Wanted, source: Source, used: Collection[str]) -> str:
    name = request.name or model_name(source.open())
    stem = name if _is_name(name) else re.sub(r"[^A-Za-z0-9_]", "_", name or source.stem)
    if not _is_name(stem):
        stem = f"entity_{stem}"[:_MAX_NAME]
    if not _is_name(name):
        if not request.allow_renaming:
            raise ResultError(
                SpawnResult.NAME_INVALID,
                f"the request has no name, and that of the model is {quoted(name)}; give a name or allow_renaming",
            )
        name = stem if name else ""
    if name and name not in used:
        return name
    if not request.allow_renaming:
        raise ResultError(SpawnResult.NAME_NOT_UNIQUE, f"name {quoted(name)} is in use; give another or allow_renaming")
    number = 1
    while f"{stem}_{number}" in used:
        number += 1
    return f"{stem}_{number}"


def _spawnable(uri: str, library: Library, cache: dict[tuple[Path, int], Bounds]) -> Spawnable:
    """Returns the description of a model. Builder thread."""
    description, bounds = "", EMPTY
    try:
        source = library.find(uri)
        assert source.path is not None
        key = source.path, source.path.stat().st_mtime_ns
        if key not in cache:
            model = compose(Recipe(source)).model
            data = mujoco.MjData(model)
            mujoco.mj_kinematics(model, data)
            found = corners(model, data, np.arange(model.ngeom), np.zeros(3), np.eye(3))
            cache[key] = EMPTY if found is None else box(*found)
        bounds = cache[key]
    except (CompositionError, OSError) as error:
        description = f"it cannot be spawned: {error}"
    return Spawnable(entity_resource=Resource(uri=uri), description=description, spawn_bounds=bounds)


def _refused(error: CompositionError) -> SpawnResult:
    return SpawnResult(result=Result(result=_CODES[error.problem], error_message=str(error)))
