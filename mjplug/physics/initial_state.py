"""The state in which the simulation starts, beyond a keyframe: a start-position file, positions by joint, controls."""

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from xml.parsers.expat import ExpatError

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import ModelError, RequestError
from mjplug.model.actuator_law import Drives, actuator_law
from mjplug.model.xml_positions import Element, parse
from mjplug.physics.simulation import Simulation

_MOST_BYTES = 16 << 20
_JOINT = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_SCALAR = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


def read_start_positions(simulation: Simulation, file: Path) -> dict[str, NDArray[np.float64]]:
    """Reads a start-position file, as mujoco_ros2_control has it: `<key qpos="…" qvel="…" ctrl="…"/>`.

    `qpos` must be there; `qvel`, `ctrl` and `act` may be. Other attributes of a keyframe are not used.

    Args:
        simulation: Whose model the numbers are for.
        file: The file.

    Returns:
        The vectors by name, each as long as the model's.

    Raises:
        ModelError: It cannot be read, or does not fit the model; the sentence has the file and the line.
    """
    root = _root(file)
    place = f"{file}:{root.line}"
    if root.tag != "key":
        raise ModelError(f"{place}: the root of a start-position file is <key qpos=… qvel=… ctrl=…>, not <{root.tag}>")
    if not root.attributes.get("qpos", "").strip():
        raise ModelError(f"{place}: <key> has no qpos")
    model = simulation.model
    lengths = {"qpos": model.nq, "qvel": model.nv, "ctrl": model.nu, "act": model.na}
    found = {}
    for name, length in lengths.items():
        words = root.attributes.get(name, "").split()
        if not words:
            continue
        if len(words) != length:
            raise ModelError(f"{place}: {name} has {len(words)} numbers, but the model has {length}")
        found[name] = np.array([_number(word, name, place) for word in words])
    return found


def start_from(simulation: Simulation, vectors: Mapping[str, NDArray[np.float64]]) -> None:
    """Puts whole vectors into the state; those that are not given become zero, quaternions get unit length.

    Args:
        simulation: What to change. Call `Simulation.keep_as_initial` when all is in place.
        vectors: What `read_start_positions` returned.
    """
    data = simulation.data
    data.qpos[:] = vectors["qpos"]
    mujoco.mj_normalizeQuat(simulation.model, data.qpos)
    for name in ("qvel", "ctrl", "act"):
        getattr(data, name)[:] = vectors.get(name, 0.0)


def check_position(simulation: Simulation, joint: str, position: float) -> None:
    """Checks where a joint is to start.

    Args:
        simulation: Whose joint it is.
        joint: The joint's name.
        position: Where it is to start [rad, m].

    Raises:
        RequestError: There is no such hinge or slide, or the position is outside its range.
    """
    model, number = simulation.model, simulation.joint_id(joint)
    if int(model.jnt_type[number]) not in _SCALAR:
        raise RequestError("only hinge and slide joints have one position; a keyframe or a file can place the others")
    if model.jnt_limited[number]:
        low, high = model.jnt_range[number]
        if not low <= position <= high:
            raise RequestError(f"{position:g} is outside the joint's range [{low:g}, {high:g}]")


def place_joints(simulation: Simulation, positions: Mapping[str, float]) -> None:
    """Puts joints where they are to start; each has been checked.

    Args:
        simulation: What to change.
        positions: By name of the joint [rad, m].
    """
    for joint, position in positions.items():
        simulation.data.qpos[simulation.model.jnt_qposadr[simulation.joint_id(joint)]] = position


def hold_pose(simulation: Simulation, joints: Collection[str] | None = None) -> int:
    """Sets the targets of position servos to where they are; without load they then stay there.

    Args:
        simulation: What to change.
        joints: Names of the joints whose servos are meant; None is all servos, those of tendons too.

    Returns:
        Of how many it was another one before.
    """
    model, data = simulation.model, simulation.data
    simulation.forward()
    meant = None if joints is None else {simulation.joint_id(joint) for joint in joints}
    changed = 0
    for actuator in range(model.nu):
        law = actuator_law(model, actuator)
        integrates = bool(model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR)
        if law.drives is not Drives.POSITION and not (law.drives is Drives.VELOCITY and integrates):
            continue
        if meant is not None and not (_is_joint(model, actuator) and int(model.actuator_trnid[actuator, 0]) in meant):
            continue
        before = data.ctrl[actuator], data.act.copy()
        target = law.control(float(data.actuator_length[actuator]))
        if not integrates:
            if model.actuator_ctrllimited[actuator]:
                low, high = model.actuator_ctrlrange[actuator].tolist()
                target = min(max(target, low), high)
            data.ctrl[actuator] = target
        if model.actuator_actnum[actuator]:
            # An activation follows the control only in time, and with an integrator it is the target itself.
            data.act[model.actuator_actadr[actuator] + model.actuator_actnum[actuator] - 1] = target
        changed += before[0] != data.ctrl[actuator] or bool((before[1] != data.act).any())
    return changed


def _is_joint(model: mujoco.MjModel, actuator: int) -> bool:
    return int(model.actuator_trntype[actuator]) in _JOINT


def _root(file: Path) -> Element:
    try:
        with file.open("rb") as opened:
            content = opened.read(_MOST_BYTES + 1)
    except OSError as error:
        raise ModelError(f"{file} cannot be read: {error.strerror}") from error
    if len(content) > _MOST_BYTES:
        raise ModelError(f"{file} is larger than {_MOST_BYTES >> 20} MiB, so it is no start-position file")
    try:
        return parse(content)
    except ExpatError as error:
        raise ModelError(f"{file}:{error.lineno}: {error}") from error


def _number(word: str, name: str, place: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise ModelError(f"{place}: {name} has {word!r}, which is no number") from None
    if not math.isfinite(value) or abs(value) >= mujoco.mjMAXVAL:
        raise ModelError(
            f"{place}: {name} has {word!r}; MuJoCo takes nothing infinite, NaN or beyond {mujoco.mjMAXVAL:g}"
        )
    return value
