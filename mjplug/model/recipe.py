"""How a model is composed: a base model, without some of its bodies, and with spawned models.

Each change composes a fresh MjSpec, because one that failed to compile cannot be compiled again, and one that is
changed again and again grows.
"""

import contextlib
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import ModelError
from mjplug.model import lidar_extension, urdf, values
from mjplug.model.text import message_of
from mjplug.model.values import Value

KINDS: Mapping[str, tuple[mujoco.mjtObj, str, str, str]] = {
    "body": (mujoco.mjtObj.mjOBJ_BODY, "bodies", "nbody", "name_bodyadr"),
    "joint": (mujoco.mjtObj.mjOBJ_JOINT, "joints", "njnt", "name_jntadr"),
    "geom": (mujoco.mjtObj.mjOBJ_GEOM, "geoms", "ngeom", "name_geomadr"),
    "site": (mujoco.mjtObj.mjOBJ_SITE, "sites", "nsite", "name_siteadr"),
    "camera": (mujoco.mjtObj.mjOBJ_CAMERA, "cameras", "ncam", "name_camadr"),
    "light": (mujoco.mjtObj.mjOBJ_LIGHT, "lights", "nlight", "name_lightadr"),
    "actuator": (mujoco.mjtObj.mjOBJ_ACTUATOR, "actuators", "nu", "name_actuatoradr"),
    "sensor": (mujoco.mjtObj.mjOBJ_SENSOR, "sensors", "nsensor", "name_sensoradr"),
    "tendon": (mujoco.mjtObj.mjOBJ_TENDON, "tendons", "ntendon", "name_tendonadr"),
    "equality": (mujoco.mjtObj.mjOBJ_EQUALITY, "equalities", "neq", "name_eqadr"),
}
"""Kinds of elements whose ids change: type, list of MjSpec, number and addresses of names in MjModel."""

_TEMPORARY = "\x01mjplug "
"""Begin of the names that unnamed elements get while a model is composed. XML cannot contain this character."""

_WORLD_BODY = 0
_NICENESS = 5
"""The compiler gets less processor time than physics, as worker processes do."""

_UNKNOWN_FORMAT = "Unrecognized XML model type"


class CompositionError(ModelError):
    """A model cannot be composed.

    Attributes:
        problem: `format`, `parse` or `assets`.
    """

    def __init__(self, problem: str, text: str) -> None:
        super().__init__(text)
        self.problem = problem


@dataclass(frozen=True, slots=True)
class Source:
    """A model as a file, or as XML text.

    Attributes:
        path: The file; None for text.
        text: The text, if there is no file.
    """

    path: Path | None
    text: str = ""

    @property
    def stem(self) -> str:
        """The name of the file without its suffix; `model` for text."""
        return self.path.stem if self.path is not None else "model"

    def open(self) -> mujoco.MjSpec:
        """Reads the model.

        Raises:
            CompositionError: It cannot be read.
        """
        try:
            return mujoco.MjSpec.from_string(self.text) if self.path is None else _read(self.path)
        except OSError as error:
            raise CompositionError("assets", f"{error.filename} cannot be read: {error.strerror}") from error
        except (ValueError, RuntimeError, mujoco.FatalError) as error:
            raise _explained(error) from error


@dataclass(frozen=True, slots=True)
class Spawned:
    """A spawned entity.

    Attributes:
        name: Its name; `<name>/` is before all names in its model.
        source: Its model.
        position: Its position in the world [m].
        quat_wxyz: Its orientation in the world.
    """

    name: str
    source: Source
    position: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Recipe:
    """A base model and its changes.

    Attributes:
        base: The base model.
        deleted: Numbers of the bodies of the base model that are left out, children of the world.
        spawned: The spawned entities, in the order in which they were added.
        values: Values of the compiled model that were changed, in this order; see `mjplug.model.values`.
    """

    base: Source
    deleted: frozenset[int] = frozenset()
    spawned: tuple[Spawned, ...] = ()
    values: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True)
class Composition:
    """A composed model.

    Attributes:
        model: The compiled model.
        keys: For each kind of element, what identifies each one in any composition of the same recipe, by id.
        notes: What MuJoCo warned about.
    """

    model: mujoco.MjModel
    keys: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = field(default=())


def compose(recipe: Recipe) -> Composition:
    """Composes and compiles a model; takes seconds for a model with large meshes, during which other threads run.

    Raises:
        CompositionError: It cannot be composed.
        RequestError: An element cannot have a changed value.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        spec = recipe.base.open()
        _name_all(spec)
        if recipe.deleted:
            _delete(spec, recipe.deleted)
        for entity in recipe.spawned:
            _attach(spec, entity)
        try:
            for value in recipe.values:
                values.apply(spec, value)
            model = _compile(spec)
        except (ValueError, RuntimeError, mujoco.FatalError) as error:
            raise _explained(error) from error
    keys = {kind: _keys(model, kind) for kind in KINDS}
    _blank_names(model)
    notes = tuple(dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught))
    return Composition(model, keys, notes)


def _compile(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compiles in a thread with a lower priority than physics, from which the compiler's own threads inherit it.

    Only the compiler has it: a thread that waits for a processor while it holds Python's global interpreter lock would
    delay physics.
    """
    outcome: Future[mujoco.MjModel] = Future()

    def run() -> None:
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            outcome.set_result(spec.compile())
        except Exception as error:
            # Raised again by `result`.
            outcome.set_exception(error)

    threading.Thread(target=run, name="mjplug compiler", daemon=True).start()
    return outcome.result()


def model_name(spec: mujoco.MjSpec) -> str:
    """Returns the name that a model gives itself; empty if it gives none."""
    return "" if spec.modelname == "MuJoCo Model" else str(spec.modelname)


def maps_between(
    old: Mapping[str, tuple[str, ...]], new: Mapping[str, tuple[str, ...]]
) -> dict[str, NDArray[np.int64]]:
    """Returns, for each kind, the new id of each old one; -1 if the element is gone."""
    maps = {}
    for kind, keys in old.items():
        ids = {key: index for index, key in enumerate(new[kind])}
        maps[kind] = np.array([ids.get(key, -1) for key in keys], np.int64)
    return maps


def _read(path: Path) -> mujoco.MjSpec:
    suffix = path.suffix.lower()
    if suffix == ".mjb":
        raise CompositionError("format", f"{path.name} is a compiled model, which cannot be composed with others")
    if suffix == ".mjz":
        with path.open("rb") as file:
            return mujoco.MjSpec.from_zip(file)
    if suffix == ".urdf":
        found = urdf.prepared(path, os.environ)
        if found is not None:
            return mujoco.MjSpec.from_string(found.xml, assets=dict(found.assets))
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        if lidar_extension.PLUGIN not in message_of(error):
            raise
    main = os.path.abspath(path)
    files = lidar_extension.overlay(main, lambda name: Path(name).read_bytes() if os.path.isfile(name) else None)
    return mujoco.MjSpec.from_file(main, include=dict(files))


def _attach(spec: mujoco.MjSpec, entity: Spawned) -> None:
    child = entity.source.open()
    for number, body in enumerate(child.worldbody.bodies):
        if not body.name:
            # The names of its bodies show clients to which entity they belong.
            body.name = f"body_{number}"
    _name_all(child)
    where = {"pos": entity.position, "quat": entity.quat_wxyz}
    if any(_is_free(body) for body in child.worldbody.bodies):
        # A body with a free joint must be a child of the world.
        frame = spec.worldbody.add_frame(**where)
    else:
        # A mocap body, so that the entity can be moved.
        frame = spec.worldbody.add_body(name=entity.name, mocap=True, **where).add_frame()
    try:
        spec.attach(child, prefix=f"{entity.name}/", frame=frame)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise _explained(error) from error


def _is_free(body: Any) -> bool:
    return any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in body.joints)


def _delete(spec: mujoco.MjSpec, deleted: frozenset[int]) -> None:
    # The numbers are ids in the compiled base model, whose bodies are ordered as here.
    bodies = list(spec.bodies)
    for number in sorted(deleted, reverse=True):
        spec.delete(bodies[number])


def _named(spec: mujoco.MjSpec) -> Iterator[tuple[str, list[Any]]]:
    for kind, (_, attribute, _, _) in KINDS.items():
        yield kind, list(getattr(spec, attribute))


def _name_all(spec: mujoco.MjSpec) -> None:
    for kind, elements in _named(spec):
        for number, element in enumerate(elements):
            if not element.name:
                element.name = f"{_TEMPORARY}{kind} {number}"


def _keys(model: mujoco.MjModel, kind: str) -> tuple[str, ...]:
    type_, _, count, _ = KINDS[kind]
    return tuple(mujoco.mj_id2name(model, type_, index) or "" for index in range(getattr(model, count)))


def _blank_names(model: mujoco.MjModel) -> None:
    """Makes the elements with temporary names unnamed again."""
    empty = bytes(model.names).index(b"\0")
    for type_, _, count, addresses in KINDS.values():
        for index in range(getattr(model, count)):
            if _TEMPORARY in (mujoco.mj_id2name(model, type_, index) or ""):
                getattr(model, addresses)[index] = empty


def _explained(error: Exception) -> CompositionError:
    text = "; ".join(line.strip() for line in message_of(error).splitlines() if line.strip())
    if _UNKNOWN_FORMAT in text:
        return CompositionError("format", text)
    missing = ("Error opening file", "could not open", "not found", "unknown file type", "No decoder")
    return CompositionError("assets" if any(words in text for words in missing) else "parse", text)


Edit = Callable[[Recipe], Recipe]
"""A change of a recipe."""
