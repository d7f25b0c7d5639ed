"""The record of a conversion, `conversion.json`: every number that was chosen, and hashes of all files."""

import hashlib
from collections.abc import Mapping, Sequence

import mujoco

from mjplug.convert.actuators import Drive
from mjplug.convert.report import Report
from mjplug.convert.robot import Robot

FORMAT = 1
"""Version of the layout of the record."""


def digest(content: bytes) -> str:
    """Returns a hash of the content of a file."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def counts_of(robot: Robot, model: mujoco.MjModel, drives: Sequence[Drive], meshes: int) -> dict[str, int]:
    """Returns the numbers of links, joints, actuators by kind, sensors, cameras and mesh files."""
    joints = robot.scalar_joints
    kinds = [drive.kind for drive in drives]
    return {
        "links": len(robot.links),
        "joints": len(joints),
        "mimic": sum(joint.mimic is not None for joint in joints),
        **{kind: kinds.count(kind) for kind in ("position", "velocity", "motor")},
        "sensors": int(model.nsensor),
        "cameras": int(model.ncam),
        "meshes": meshes,
    }


def record_of(robot: Robot, drives: Sequence[Drive], home: Mapping[str, float], report: Report) -> dict[str, object]:
    """Returns the chosen values of each joint [SI units], and the notes of the report."""
    joints = {
        drive.joint: {
            "actuator": drive.kind,
            "effort": drive.effort,
            "velocity": robot.joints[drive.joint].velocity,
            "armature": drive.armature,
            "damping": drive.damping,
            "kp": drive.kp,
            "kv": drive.kv,
            "home": home.get(drive.joint),
        }
        for drive in drives
    }
    return {
        "format": FORMAT,
        "mujoco": mujoco.mj_versionString(),
        "robot": robot.name,
        "joints": joints,
        "notes": report.as_json(),
    }
