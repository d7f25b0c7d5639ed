"""Puts an MJCF model into a scene: the scene replaces the model's own floor, lights and sky."""

import logging
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjplug.convert.measure import lowest_of
from mjplug.convert.scene import NONE, Placement, bundled_scene, corners_of, scene_names, unknown_scene
from mjplug.errors import ModelError
from mjplug.model.text import message_of

PREFIX = "scene_"
"""Prefix of the names of everything in the scene."""

_PLANE, _SKYBOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtTexture.mjTEXTURE_SKYBOX
_SUFFIXES = (".xml", ".mjcf")

_OVERLAP = 0.002
"""Depth from which an object of the scene overlaps the model [m]."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Floor:
    """The floor of a model: names of its planes, and the height of the highest one; None without planes [m]."""

    planes: tuple[str, ...]
    height: float | None


def model_in_scene(path: Path, scene: str) -> mujoco.MjModel:
    """Compiles an MJCF model in a scene.

    The options, defaults and keyframes are those of the model. Planes, lights and skyboxes of its world are removed,
    its other objects are kept.

    Args:
        path: The MJCF file.
        scene: A name of the library, `none`, or an MJCF file.

    Raises:
        ModelError: The model is no MJCF file, there is no such scene, or MuJoCo cannot compile them.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise ModelError(
            f"{path} cannot be put into the scene {scene!r}; only URDF, xacro and MJCF files can (without --scene, the "
            "model is simulated as it is)"
        )
    try:
        model = _compiled(path, scene, set())
        left_out = _overlapping(model) if scene in scene_names() else set()
        if left_out:
            names = ", ".join(sorted(name.removeprefix(PREFIX) for name in left_out))
            _log.info("objects of the scene %r that would overlap the model are left out: %s", scene, names)
            model = _compiled(path, scene, left_out)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = "; ".join(line.strip() for line in message_of(error).splitlines() if line.strip())
        raise ModelError(f"{path} cannot be put into the scene {scene!r}: {reason}") from error
    return model


def _compiled(path: Path, scene: str, left_out: set[str]) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(path))
    place = _placement(spec)
    floor = _remove_surroundings(spec)
    if scene != NONE:
        _attach(spec, scene, place, floor, left_out)
    model: mujoco.MjModel = spec.compile()
    return model


def _attach(spec: mujoco.MjSpec, name: str, place: Placement, floor: _Floor, left_out: set[str]) -> None:
    if name in scene_names():
        other = mujoco.MjSpec.from_string(_library_scene(name, place, floor, left_out))
        for part in ("headlight", "quality"):
            setattr(spec.visual, part, getattr(other.visual, part))
        spec.visual.rgba.haze = other.visual.rgba.haze
        offset = np.zeros(3)
    else:
        other = _from_file(Path(name))
        offset = np.array([0.0, 0.0, floor.height or 0.0])
    spec.attach(other, prefix=PREFIX, frame=spec.worldbody.add_frame(pos=offset))
    floors = [geom.name for geom in spec.worldbody.geoms if geom.type == _PLANE and geom.name.startswith(PREFIX)]
    if floors:
        _repoint(spec, floor.planes, floors[0])


def _library_scene(name: str, place: Placement, floor: _Floor, left_out: set[str]) -> str:
    root = bundled_scene(name, place, floor.height)
    for world in root.iterfind("worldbody"):
        for element in [part for part in world if f"{PREFIX}{part.get('name')}" in left_out]:
            world.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _overlapping(model: mujoco.MjModel) -> set[str]:
    """Returns the objects of the scene that are inside something of the model, in its default pose or a keyframe."""
    data, found = mujoco.MjData(model), set()
    for key in range(-1, model.nkey):
        if key >= 0:
            mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        for index in range(data.ncon):
            contact = data.contact[index]
            names = [_object(model, int(geom)) for geom in contact.geom]
            of_scene = [name.startswith(PREFIX) for name in names]
            if contact.dist < -_OVERLAP and of_scene[0] != of_scene[1]:
                found.add(names[of_scene.index(True)])
    planes = {model.geom(i).name for i in range(model.ngeom) if model.geom_type[i] == _PLANE}
    return found - planes


def _object(model: mujoco.MjModel, geom: int) -> str:
    """Returns the name of the top body of a geom; for a geom of the world, its own."""
    root = int(model.body_rootid[model.geom_bodyid[geom]])
    return str(model.body(root).name if root else model.geom(geom).name)


def _from_file(path: Path) -> mujoco.MjSpec:
    if not path.is_file():
        raise unknown_scene(str(path))
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ModelError(f"the scene {path} cannot be read: {' '.join(message_of(error).split())}") from error


def _remove_surroundings(spec: mujoco.MjSpec) -> _Floor:
    """Removes the planes and lights of the world, and the skyboxes."""
    planes = [geom for geom in spec.worldbody.geoms if geom.type == _PLANE]
    floor = _Floor(
        tuple(plane.name for plane in planes if plane.name),
        max((float(plane.pos[2]) for plane in planes), default=None),
    )
    for element in [*planes, *spec.worldbody.lights, *(t for t in spec.textures if t.type == _SKYBOX)]:
        spec.delete(element)
    return floor


def _repoint(spec: mujoco.MjSpec, planes: tuple[str, ...], floor: str) -> None:
    """Lets contact pairs and sensors name the floor of the scene instead of a removed plane."""
    for pair in spec.pairs:
        pair.geomname1 = floor if pair.geomname1 in planes else pair.geomname1
        pair.geomname2 = floor if pair.geomname2 in planes else pair.geomname2
    for sensor in spec.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_GEOM and sensor.objname in planes:
            sensor.objname = floor
        if sensor.reftype == mujoco.mjtObj.mjOBJ_GEOM and sensor.refname in planes:
            sensor.refname = floor


def _placement(spec: mujoco.MjSpec) -> Placement:
    """Returns the place of the robot: the tree of the first actuated joint, else of the first joint."""
    model = spec.copy().compile()
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    joints = [int(model.actuator_trnid[i, 0]) for i in range(model.nu) if model.actuator_trntype[i] == 0]
    joint = (joints or list(range(model.njnt)))[:1]
    root = int(model.body_rootid[model.jnt_bodyid[joint[0]]]) if joint else 0
    own = [
        geom
        for geom in range(model.ngeom)
        if model.body_rootid[model.geom_bodyid[geom]] == root and model.geom_type[geom] != _PLANE
    ]
    corners = corners_of(model, data, own)
    low, high = corners.min(axis=0), corners.max(axis=0)
    first = model.body_jntadr[root]
    free = bool(joint) and first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
    center = (low + high) / 2.0
    lowest = min((lowest_of(model, data, geom) for geom in own), default=0.0)
    place = (float(center[0]), float(center[1]), float(center[2]))
    return Placement(free, min(lowest, 0.0), float(high[0]), place, 0.9 * float(np.linalg.norm(high - low)))
