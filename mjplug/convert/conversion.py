"""The conversion: from a URDF or xacro file to the files of a model."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjplug.convert.actuators import Drive, DriveRules, write_drives
from mjplug.convert.base import floating_joint, home_positions, stands_freely, wheels_of
from mjplug.convert.check import check_model
from mjplug.convert.configuration import Configuration
from mjplug.convert.contacts import read_srdf, write_casters, write_excludes
from mjplug.convert.control import read_control
from mjplug.convert.decompose import Decomposer
from mjplug.convert.gazebo import read_gazebo
from mjplug.convert.materials import Materials
from mjplug.convert.measure import Measured, lowest_of, lowest_points, measure, set_positions
from mjplug.convert.mesh_assets import MeshAssets
from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.options import ConversionOptions
from mjplug.convert.read_urdf import read_robot
from mjplug.convert.report import Report, to_json
from mjplug.convert.robot import Joint, Robot
from mjplug.convert.rotations import numbers
from mjplug.convert.scene import ROBOT_FILE, SCENE_FILE, Placement, build_scene, write_home
from mjplug.convert.source import Source
from mjplug.convert.write_bodies import BodyWriter
from mjplug.errors import ModelError
from mjplug.model.packages import Packages
from mjplug.model.text import message_of

ASSETS, DESCRIPTION, CONFIGURATION, RECORD = "assets", "robot.urdf", "mjplug.yaml", "conversion.json"
"""Names in the folder of a converted robot."""

FORMAT = 1
"""Version of the conversion; a new one makes cached models invalid."""

Progress = Callable[[str, float], None]
"""Gets the name of a stage, and the finished part of the whole conversion, from 0 to 1."""

_CLEARANCE = 0.001
"""Height of a free robot above the floor [m]."""


@dataclass(slots=True)
class Conversion:
    """A converted robot.

    Attributes:
        name: Name of the robot.
        files: Contents of the files by their paths in the folder.
        report: What was guessed, repaired and lost.
        counts: Numbers of links, joints and so on.
        free: Whether the base is free.
        drives: The drives of the joints.
        home: The home pose.
    """

    name: str
    files: dict[str, bytes]
    report: Report
    counts: dict[str, int]
    free: bool
    drives: list[Drive] = field(default_factory=list)
    home: dict[str, float] = field(default_factory=dict)


def convert(
    source: Source,
    options: ConversionOptions,
    packages: Packages,
    decompositions: Path | None = None,
    progress: Progress = lambda stage, part: None,
) -> Conversion:
    """Converts a robot.

    Args:
        source: The expanded file.
        options: The options; paths in it are absolute or relative to the current folder.
        packages: The packages of its meshes.
        decompositions: Folder of a cache of decomposed meshes; None for none.
        progress: Is called while the conversion runs.

    Raises:
        ModelError: The robot cannot be converted.
    """
    try:
        return _Pipeline(source, options, packages, decompositions, progress).run()
    except ModelError as error:
        raise ModelError(f"{source.path}: {error}") from error


class _Pipeline:
    """The steps of one conversion, which share the robot and the report."""

    def __init__(
        self,
        source: Source,
        options: ConversionOptions,
        packages: Packages,
        decompositions: Path | None,
        progress: Progress,
    ) -> None:
        self.source, self.options, self.progress = source, options, progress
        self.report = Report()
        for warning in source.warnings:
            self.report.add("warning", "xacro", source.path.name, warning)
        self.robot: Robot = read_robot(source.root, self.report)
        self.control = read_control(source.root, self.robot, self.report)
        self.gazebo = read_gazebo(source.root, self.robot, self.report)
        self.finder = MeshFiles(source.path.absolute().parent, packages)
        self.materials = Materials(self.report)
        decomposer = Decomposer(decompositions, self.report)
        self.meshes = MeshAssets(self.finder, self.materials, options, decomposer, self.report)
        self.wheels: list[Joint] = wheels_of(self.robot)

    def run(self) -> Conversion:
        """Returns the converted robot."""
        robot, options, report = self.robot, self.options, self.report
        disabled, srdf_home = read_srdf(Path(options.srdf), robot) if options.srdf else ([], {})
        home = home_positions(robot, self.control, srdf_home, report)
        self.progress("meshes", 0.05)
        bodies = BodyWriter(robot, options, self.gazebo, self.meshes, self.materials, report)
        mjcf = bodies.write(options.sites)
        assets = {f"{ASSETS}/{name}": content for name, content in (self.meshes.files | self.materials.files).items()}
        self.progress("compiling", 0.5)
        model = _compiled(mjcf, assets)
        data = self._at(model, home)
        free = stands_freely(robot, options, self.wheels, lowest_points(robot, model, data), report)
        if free or floating_joint(robot) is not None:
            self._set_free(mjcf, bodies, free, lowest_points(robot, model, data))
            model = _compiled(mjcf, assets)
            data = self._at(model, home)
        self.progress("measuring", 0.6)
        measured = measure(robot, model, home, options.self_collision == "auto")
        drives = self._write_dynamics(mjcf, model, data, measured, free, disabled)
        self.progress("scene", 0.85)
        place = _placement(robot, model, data, free or floating_joint(robot) is not None)
        scene = build_scene(options.scene, robot.name, place, {name.lower() for name in self._asset_stems()})
        assets |= {f"{ASSETS}/{name}": content for name, content in scene.files.items()}
        files = {ROBOT_FILE: mjcf.text().encode()}
        model = _from_text(scene.text(), {**files, ROBOT_FILE: mjcf.text_without_pictures().encode(), **assets})
        qpos, ctrl = self._home_state(model, home)
        write_home(scene.root, model, qpos, ctrl)
        files[SCENE_FILE] = scene.text().encode()
        self.progress("checking", 0.9)
        model = _from_text(scene.text(), {**files, **assets})
        check_model(robot, model, fused=options.fuse)
        files[DESCRIPTION] = self._description()
        files[CONFIGURATION] = Configuration(robot, free, self.wheels).text().encode()
        files |= assets
        counts = self._counts(model, drives)
        record = self._record(files, counts, drives, home, free)
        files[RECORD] = to_json(record).encode()
        self.progress("done", 1.0)
        return Conversion(robot.name, files, report, counts, free, drives, home)

    def _at(self, model: mujoco.MjModel, home: Mapping[str, float]) -> mujoco.MjData:
        data = mujoco.MjData(model)
        set_positions(self.robot, model, data, home)
        mujoco.mj_kinematics(model, data)
        return data

    def _set_free(self, mjcf: Mjcf, bodies: BodyWriter, root_is_free: bool, lowest: Mapping[str, float]) -> None:
        """Gives the base a free joint, and puts the robot on the floor."""
        robot = self.robot
        floating = floating_joint(robot)
        base = robot.root if floating is None else floating.child
        body = mjcf.bodies[base]
        if root_is_free:
            bodies.give_mass_to_root(mjcf)
            joint = ElementTree.Element("freejoint", name=f"{robot.root}_free")
            body.insert(0, joint)
        height = _CLEARANCE - min(lowest.values(), default=0.0)
        position = np.array([float(part) for part in body.get("pos", "0 0 0").split()]) + (0.0, 0.0, height)
        body.set("pos", numbers(position))
        self.report.add("guess", "height of the base above the floor in the home pose", base, f"{position[2]:.4g} m")

    def _write_dynamics(
        self, mjcf: Mjcf, model: mujoco.MjModel, data: mujoco.MjData, measured: Measured, free: bool,
        disabled: list[tuple[str, str]],
    ) -> list[Drive]:  # fmt: skip
        robot, options, report = self.robot, self.options, self.report
        floats = free or floating_joint(robot) is not None
        mass = float(model.body_subtreemass[0])
        rules = DriveRules(robot, self.control, options, self.wheels, measured, mass, floats, report)
        drives = rules.drives()
        write_drives(mjcf, robot, drives, report)
        write_excludes(mjcf, robot, options, measured.touching, disabled, report)
        if floats and self.wheels:
            lowest = {
                model.geom(geom).name: lowest_of(model, data, geom)
                for geom in range(model.ngeom)
                if model.geom(geom).name
            }
            write_casters(mjcf, robot, self.wheels, lowest, report)
        return drives

    def _home_state(self, model: mujoco.MjModel, home: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        data = self._at(model, home)
        ctrl = np.zeros(model.nu)
        for actuator in range(model.nu):
            name = model.actuator(actuator).name
            if name in home and model.actuator_biasprm[actuator, 1]:
                ctrl[actuator] = home[name]
        return data.qpos.copy(), ctrl

    def _asset_stems(self) -> list[str]:
        return [Path(name).stem for name in (*self.meshes.files, *self.materials.files)]

    def _description(self) -> bytes:
        """Returns the expanded URDF, without absolute paths."""
        root = self.source.root
        for element in [*root.iter("mesh"), *root.iter("texture")]:
            uri = element.get("filename", "")
            if uri:
                portable = self.finder.portable(uri)
                element.set("filename", Path(uri).name if portable is None else portable)
        return (ElementTree.tostring(root, encoding="unicode", xml_declaration=True).rstrip() + "\n").encode()

    def _counts(self, model: mujoco.MjModel, drives: list[Drive]) -> dict[str, int]:
        joints = self.robot.scalar_joints
        kinds = [drive.kind for drive in drives]
        return {
            "links": len(self.robot.links),
            "joints": len(joints),
            "mimic": sum(joint.mimic is not None for joint in joints),
            **{kind: kinds.count(kind) for kind in ("position", "velocity", "motor")},
            "sensors": int(model.nsensor),
            "cameras": int(model.ncam),
            "meshes": len(self.meshes.files),
        }

    def _record(
        self,
        files: Mapping[str, bytes],
        counts: dict[str, int],
        drives: list[Drive],
        home: Mapping[str, float],
        free: bool,
    ) -> dict[str, object]:
        joints = {
            drive.joint: {
                "actuator": drive.kind, "effort": drive.effort, "velocity": self.robot.joints[drive.joint].velocity,
                "armature": drive.armature, "damping": drive.damping, "kp": drive.kp, "kv": drive.kv,
                "home": home.get(drive.joint),
            }
            for drive in drives
        }  # fmt: skip
        sources = {uri: digest(path.read_bytes()) for uri, path in self.meshes.sources.items()}
        sources = {self.finder.portable(uri) or Path(uri).name: digest for uri, digest in sources.items()}
        return {
            "format": FORMAT,
            "mujoco": mujoco.mj_versionString(),
            "source": self.source.path.name,
            "options": self.options.model_dump(mode="json", exclude_defaults=True, exclude={"packages"}),
            "robot": self.robot.name,
            "base": "free" if free else "fixed",
            "counts": counts,
            "joints": joints,
            "notes": self.report.as_json(),
            "sources": sources,
            "files": {name: digest(content) for name, content in files.items()},
        }


def digest(content: bytes) -> str:
    """Returns a hash of the content of a file."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _compiled(mjcf: Mjcf, assets: Mapping[str, bytes]) -> mujoco.MjModel:
    return _from_text(mjcf.text_without_pictures(), assets)


def _from_text(text: str, files: Mapping[str, bytes]) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(text, dict(files))
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = "; ".join(line.strip() for line in message_of(error).splitlines() if line.strip())
        raise ModelError(f"MuJoCo does not accept the converted model: {reason}") from error


def _placement(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, free: bool) -> Placement:
    fixed = set(robot.rigid_group(robot.root))
    moving = {name: value for name, value in lowest_points(robot, model, data).items() if name not in fixed}
    corners = _corners(model, data)
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2.0
    return Placement(
        free,
        min(moving.values(), default=0.0),
        float(high[0]),
        (float(center[0]), float(center[1]), float(center[2])),
        0.7 * float(np.linalg.norm(high - low)),
    )


def _corners(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Returns points that enclose all geoms, shape (n, 3) [m]."""
    reach = model.geom_rbound[:, None]
    if not len(reach):
        return np.zeros((1, 3))
    return np.concatenate([data.geom_xpos - reach, data.geom_xpos + reach])
