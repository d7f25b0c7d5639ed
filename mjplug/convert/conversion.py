"""The conversion: from a URDF or xacro file to the files of a model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjplug.convert.actuators import Drive, DriveRules, write_drives
from mjplug.convert.apply_inputs import add_sites, apply_inputs
from mjplug.convert.base import floating_joint, home_positions, stands_freely, wheels_of
from mjplug.convert.check import check_model
from mjplug.convert.configuration import Configuration
from mjplug.convert.contacts import read_srdf, write_casters, write_excludes
from mjplug.convert.control import read_control
from mjplug.convert.decompose import Decomposer
from mjplug.convert.gazebo import read_gazebo
from mjplug.convert.inputs import read_inputs
from mjplug.convert.materials import Materials
from mjplug.convert.measure import Measured, lowest_of, lowest_points, measure, set_positions
from mjplug.convert.mesh_assets import MeshAssets, thresholds_of
from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.options import ConversionOptions
from mjplug.convert.pid_gains import used_gains
from mjplug.convert.placement import placement
from mjplug.convert.read_urdf import read_robot
from mjplug.convert.record import counts_of, digest, record_of
from mjplug.convert.report import RECORD, Report, to_json
from mjplug.convert.robot import Joint, Robot
from mjplug.convert.rotations import numbers
from mjplug.convert.scene import HOME, ROBOT_FILE, SCENE_FILE, build_scene, write_home
from mjplug.convert.sensors import SensorWriter
from mjplug.convert.source import Source
from mjplug.convert.wheels import drive_train, largest_radius, write_tyres
from mjplug.convert.write_bodies import BodyWriter
from mjplug.errors import ModelError, did_you_mean
from mjplug.model.packages import Packages
from mjplug.model.text import message_of

ASSETS, DESCRIPTION, CONFIGURATION = "assets", "robot.urdf", "mjplug.yaml"
"""Names in the folder of a converted robot."""

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
        # Huge numbers in a URDF overflow; MuJoCo and the check at the end refuse the result.
        with np.errstate(over="ignore", invalid="ignore"):
            return _Pipeline(source, options, packages, decompositions, progress).run()
    except ModelError as error:
        raise ModelError(f"{source.origin or source.path}: {error}") from error


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
            self.report.add("warning", "file", source.path.name, warning)
        self.robot: Robot = read_robot(source.root, self.report)
        self.gazebo = read_gazebo(source.root, self.robot, self.report)
        self.finder = MeshFiles(source.path.absolute().parent, packages, bool(source.origin))
        self.control = read_control(source.root, self.robot, self.finder, options.strict, self.report)
        self.materials = Materials(self.report)
        self.inputs = read_inputs(source.root, options.mujoco_inputs)
        decomposer = Decomposer(decompositions, self.report)
        self.meshes = MeshAssets(
            self.finder, self.materials, options, decomposer, self.report, self.inputs.decompose, self._on_mesh
        )
        links = self.robot.links.values()
        shapes = [shape for link in links for shape in (*link.visuals, *link.collisions) if shape.shape == "mesh"]
        self.mesh_uses, self.mesh_uses_done = len(shapes), 0
        self.wheels: list[Joint] = wheels_of(self.robot)

    def run(self) -> Conversion:
        """Returns the converted robot."""
        robot, options, report = self.robot, self.options, self.report
        disabled, srdf_home = read_srdf(Path(options.srdf), robot) if options.srdf else ([], {})
        home = home_positions(robot, self.control, srdf_home, report)
        self.progress("meshes", 0.05)
        bodies = BodyWriter(robot, options, self.gazebo, self.meshes, self.materials, report)
        mjcf = bodies.write()
        self._check_decompositions()
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
        lowest = lowest_points(robot, model, data)
        train = drive_train(robot, model, data, self.wheels, drives, lowest, report) if free else None
        if train is not None:
            write_tyres(mjcf, robot, train, report)
        self.progress("scene", 0.85)
        sensors = self._write_sensors(mjcf)
        place = placement(robot, model, data, free or floating_joint(robot) is not None)
        scene = build_scene(options.scene, robot.name, place, self._asset_stems(), self.inputs.scenes)
        assets |= {f"{ASSETS}/{name}": content for name, content in scene.files.items()}
        files = {ROBOT_FILE: mjcf.text().encode()}
        model = _from_text(scene.text(), {**files, ROBOT_FILE: mjcf.text_without_pictures().encode(), **assets})
        qpos, ctrl = self._home_state(model, home)
        if HOME not in [model.key(key).name for key in range(model.nkey)]:
            write_home(scene.root, model, qpos, ctrl)
        files[SCENE_FILE] = scene.text().encode()
        self.progress("checking", 0.9)
        model = _from_text(scene.text(), {**files, **assets})
        check_model(robot, model, fused=options.fuse)
        files[DESCRIPTION] = self._description()
        control = self.control
        gains = used_gains(control.gains, mjcf, control.transmissions)
        configuration = Configuration(robot, free, train, sensors, self.inputs.lidars, control.transmissions, gains)
        files[CONFIGURATION] = configuration.text().encode()
        files |= assets
        counts = counts_of(robot, model, drives, len(self.meshes.files))
        sources = {
            self.finder.portable(uri) or Path(uri).name: digest(path.read_bytes())
            for uri, path in self.meshes.sources.items()
        }
        record = record_of(robot, drives, home, report) | {
            "source": self.source.path.name,
            "options": options.model_dump(mode="json", exclude_defaults=True, exclude={"packages"}),
            "base": "free" if free else "fixed",
            "counts": counts,
            "sources": sources,
            "files": {name: digest(content) for name, content in files.items()},
        }
        files[RECORD] = to_json(record).encode()
        self.progress("done", 1.0)
        return Conversion(robot.name, files, report, counts, free, drives, home)

    def _on_mesh(self) -> None:
        self.mesh_uses_done += 1
        self.progress("meshes", 0.05 + 0.45 * min(self.mesh_uses_done / self.mesh_uses, 1.0))

    def _check_decompositions(self) -> None:
        for link in thresholds_of(self.options.decompose):
            if link and link not in self.robot.links:
                raise ModelError(
                    f"--decompose names the link {link!r}, which the robot does not have"
                    f"{did_you_mean(link, self.robot.links)}"
                )
        stems = self.meshes.collision_stems
        for name in self.inputs.decompose:
            if name not in stems:
                known = ", ".join(sorted(stems)) or "none"
                raise ModelError(
                    f"<decompose_mesh> names the mesh {name!r}, which no link collides with"
                    f"{did_you_mean(name, stems)}; collision meshes: {known}"
                )

    def _write_sensors(self, mjcf: Mjcf) -> SensorWriter:
        """Adds the sensors, and applies `<mujoco_inputs>`."""
        if self.inputs.exist or self.options.sites:
            add_sites(mjcf)
        sensors = SensorWriter(mjcf, self.report)
        sensors.write_gazebo(self.gazebo.sensors)
        apply_inputs(mjcf, self.inputs)
        sensors.write_control(self.control.sensors)
        return sensors

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
        radius = largest_radius(robot, model, data, self.wheels, lowest_points(robot, model, data))
        rules = DriveRules(robot, self.control, options, self.wheels, measured, mass, floats, radius, report)
        drives = rules.drives()
        write_drives(mjcf, robot, drives, self.control.controlled, report)
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

    def _asset_stems(self) -> set[str]:
        return {Path(name).stem.lower() for name in (*self.meshes.files, *self.materials.files)}

    def _description(self) -> bytes:
        """Returns the expanded URDF, without absolute paths."""
        root = self.source.root
        for element in [*root.iter("mesh"), *root.iter("texture")]:
            uri = element.get("filename", "")
            if uri:
                portable = self.finder.portable(uri)
                element.set("filename", Path(uri).name if portable is None else portable)
        return (ElementTree.tostring(root, encoding="unicode", xml_declaration=True).rstrip() + "\n").encode()


def _compiled(mjcf: Mjcf, assets: Mapping[str, bytes]) -> mujoco.MjModel:
    return _from_text(mjcf.text_without_pictures(), assets)


def _from_text(text: str, files: Mapping[str, bytes]) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(text, dict(files))
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = "; ".join(line.strip() for line in message_of(error).splitlines() if line.strip())
        raise ModelError(f"MuJoCo does not accept the converted model: {reason}") from error
