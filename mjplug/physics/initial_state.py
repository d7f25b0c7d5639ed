"""The initial state beyond a keyframe: a start-position file, joint positions, and controls that hold the pose."""

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

_MAX_FILE_SIZE = 16 << 20
_JOINT = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_SCALAR = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


def read_start_positions(simulation: Simulation, file: Path) -> dict[str, NDArray[np.float64]]:
    """Reads a start-position file in the format of mujoco_ros2_control: `<key qpos="…" qvel="…" ctrl="…"/>`.

    `qpos` is required; `qvel`, `ctrl` and `act` are optional. Other attributes of a keyframe are ignored.

    Args:
        simulation: The simulation that the file is for.
        file: The file.

    Returns:
        The vectors by name: `qpos` of shape (nq,), `qvel` (nv,), `ctrl` (nu,), `act` (na,), in MuJoCo's units.

    Raises:
        ModelError: The file cannot be read or does not fit the model; the message contains the file and the line.
    """
    root = _root(file)
    place = f"{file}:{root.line}"
    if root.tag != "key":
        raise ModelError(
            f"{place}: the root element is <{root.tag}>; a start-position file needs <key qpos=… qvel=… ctrl=…>"
        )
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
            raise ModelError(f"{place}: {name} has {len(words)} numbers; the model needs {length}")
        found[name] = np.array([_number(word, name, place) for word in words])
    return found


def start_from(simulation: Simulation, vectors: Mapping[str, NDArray[np.float64]]) -> None:
    """Sets the state from vectors. Vectors that are not given are set to zero; quaternions are normalized.

    Args:
        simulation: The simulation to change. Call `Simulation.keep_as_initial` when the state is complete.
        vectors: The vectors that `read_start_positions` returned.
    """
    data = simulation.data
    data.qpos[:] = vectors["qpos"]
    mujoco.mj_normalizeQuat(simulation.model, data.qpos)
    for name in ("qvel", "ctrl", "act"):
        getattr(data, name)[:] = vectors.get(name, 0.0)


def check_position(simulation: Simulation, joint: str, position: float) -> None:
    """Checks the initial position of a joint.

    Args:
        simulation: The simulation whose model contains the joint.
        joint: The joint's name.
        position: Initial position, [rad] for a hinge, [m] for a slide.

    Raises:
        RequestError: There is no hinge or slide joint of this name, or the position is outside its range.
    """
    model, number = simulation.model, simulation.joint_id(joint)
    if int(model.jnt_type[number]) not in _SCALAR:
        raise RequestError(
            "it is neither a hinge nor a slide joint; set its position in a keyframe or in a start-position file"
        )
    if model.jnt_limited[number]:
        low, high = model.jnt_range[number]
        if not low <= position <= high:
            raise RequestError(f"{position:g} is outside the joint's range [{low:g}, {high:g}]")


def place_joints(simulation: Simulation, positions: Mapping[str, float]) -> None:
    """Sets initial joint positions, which `check_position` has accepted.

    Args:
        simulation: The simulation to change.
        positions: Position by joint name, [rad] for a hinge, [m] for a slide.
    """
    for joint, position in positions.items():
        simulation.data.qpos[simulation.model.jnt_qposadr[simulation.joint_id(joint)]] = position


def hold_pose(simulation: Simulation, joints: Collection[str] | None = None) -> int:
    """Sets the targets of position servos to their current position, where they stay unless a load moves them.

    Args:
        simulation: The simulation to change.
        joints: Names of the joints whose servos are set; None means all servos, also those of tendons.

    Returns:
        Number of actuators that got a new target.
    """
    model, data = simulation.model, simulation.data
    simulation.forward()
    selected = None if joints is None else {simulation.joint_id(joint) for joint in joints}
    changed = 0
    for actuator in range(model.nu):
        law = actuator_law(model, actuator)
        integrates = bool(model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR)
        if law.drives is not Drives.POSITION and not (law.drives is Drives.VELOCITY and integrates):
            continue
        if selected is not None and not (
            _drives_joint(model, actuator) and int(model.actuator_trnid[actuator, 0]) in selected
        ):
            continue
        before = data.ctrl[actuator], data.act.copy()
        target = law.control(float(data.actuator_length[actuator]))
        if not integrates:
            if model.actuator_ctrllimited[actuator]:
                low, high = model.actuator_ctrlrange[actuator].tolist()
                target = min(max(target, low), high)
            data.ctrl[actuator] = target
        if model.actuator_actnum[actuator]:
            # A filtered activation reaches the control only after some time; that of an integrator is the target.
            data.act[model.actuator_actadr[actuator] + model.actuator_actnum[actuator] - 1] = target
        changed += before[0] != data.ctrl[actuator] or bool((before[1] != data.act).any())
    return changed


def _drives_joint(model: mujoco.MjModel, actuator: int) -> bool:
    return int(model.actuator_trntype[actuator]) in _JOINT


def _root(file: Path) -> Element:
    try:
        with file.open("rb") as opened:
            content = opened.read(_MAX_FILE_SIZE + 1)
    except OSError as error:
        raise ModelError(f"{file} cannot be read: {error.strerror}") from error
    if len(content) > _MAX_FILE_SIZE:
        raise ModelError(f"{file} is larger than {_MAX_FILE_SIZE >> 20} MiB, the limit for a start-position file")
    try:
        return parse(content)
    except ExpatError as error:
        raise ModelError(f"{file}:{error.lineno}: {error}") from error


def _number(word: str, name: str, place: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise ModelError(f"{place}: {name} contains {word!r}, which is not a number") from None
    if not math.isfinite(value) or abs(value) >= mujoco.mjMAXVAL:
        raise ModelError(
            f"{place}: {name} contains {word!r}; "
            f"it must be finite and its absolute value must be below {mujoco.mjMAXVAL:g}"
        )
    return value
