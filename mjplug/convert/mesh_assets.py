"""The meshes of a model: reads each file once, and writes one asset for each use."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mjplug.convert.collada import is_y_up
from mjplug.convert.decompose import CONCAVE, THRESHOLD, Decomposer, concavity
from mjplug.convert.materials import Materials, free_name
from mjplug.convert.mesh import Mesh, joined, read_mesh, write_obj, write_stl
from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import Report
from mjplug.convert.robot import Geometry
from mjplug.convert.rotations import Array
from mjplug.convert.simplify import MUJOCO_LIMIT, simplified
from mjplug.errors import ModelError

Kind = Literal["visual", "collision"]

_FLAT = 1e-6
"""Thickness below which a mesh is flat, as a part of its length."""

_MIN_HALF = 0.0005
"""Half of the thickness of the box that replaces a flat collision mesh [m]."""


@dataclass(frozen=True, slots=True)
class Asset:
    """One use of a mesh.

    Attributes:
        name: Name of the `<mesh>`; empty if a box replaces it.
        material: Material of the mesh file; None if the file contains none.
        box: Center, axes (3, 3) and half lengths of the box that replaces a flat collision mesh.
    """

    name: str
    material: str | None = None
    box: tuple[Array, Array, Array] | None = None


class MeshAssets:
    """The mesh files of a model.

    Attributes:
        files: Contents of files by name.
        sources: The files that were read, by URI.
        collision_stems: Names of the collision meshes, without suffix.

    Args:
        finder: Finds files.
        materials: Gets the colours and textures of mesh files.
        options: The options.
        decomposer: Divides collision meshes.
        report: The report.
        by_mesh: Thresholds of meshes to divide, by their names without suffix.
        on_mesh: Is called when a mesh is done.
    """

    def __init__(
        self,
        finder: MeshFiles,
        materials: Materials,
        options: ConversionOptions,
        decomposer: Decomposer,
        report: Report,
        by_mesh: Mapping[str, float] = MappingProxyType({}),
        on_mesh: Callable[[], None] = lambda: None,
    ) -> None:
        self.files: dict[str, bytes] = {}
        self.sources: dict[str, Path] = {}
        self._finder, self._materials, self._options = finder, materials, options
        self._decomposer, self._report = decomposer, report
        self._read: dict[Path, list[Mesh] | ModelError] = {}
        self._assets: dict[tuple[object, ...], list[Asset]] = {}
        self._written: dict[bytes, str] = {}
        self._meshes: list[tuple[str, str, Kind]] = []
        self._names: set[str] = set()
        self._file_names: set[str] = set()
        self._thresholds = thresholds_of(options.decompose)
        self._by_mesh = dict(by_mesh)
        self._on_mesh = on_mesh
        self.collision_stems: set[str] = set()

    def use(self, geometry: Geometry, kind: Kind, link: str) -> list[Asset]:
        """Returns the assets of a mesh; none if it is missing or broken, which the report says.

        Raises:
            ModelError: The mesh is missing, and the options are strict; or a library is not installed.
        """
        self._on_mesh()
        path = self._find(geometry.mesh, kind, link)
        if path is None:
            return []
        threshold = self._threshold(link, path.stem) if kind == "collision" else None
        if kind == "collision":
            self.collision_stems.add(path.stem)
        key = (path, geometry.scale, kind, threshold)
        # The report lists each link of a broken mesh.
        parts = self._parts(path, kind, link)
        if key not in self._assets:
            self._assets[key] = self._add(parts, path.stem, geometry.scale, kind, threshold)
        return self._assets[key]

    def write(self, asset: Element) -> None:
        """Adds the meshes to `<asset>`."""
        for name, file, kind in self._meshes:
            # MuJoCo computes an inertia for each mesh, also for pictures; that of a shell exists for flat ones too.
            inertia = "shell" if kind == "visual" else "convex"
            SubElement(asset, "mesh", name=name, file=file, inertia=inertia)

    def _find(self, uri: str, kind: Kind, link: str) -> Path | None:
        try:
            self.sources[uri] = self._finder.find(uri)
        except ModelError as error:
            self._missing(kind, link, str(error))
            return None
        return self.sources[uri]

    def _missing(self, kind: Kind, link: str, message: str) -> None:
        if self._options.strict:
            raise ModelError(f"link {link!r}: {message}")
        if kind == "visual":
            self._report.add("warning", "visual mesh left out", link, message)
        else:
            self._report.add("error", "collision mesh left out, so the link passes through things", link, message)

    def _parts(self, path: Path, kind: Kind, link: str) -> list[Mesh]:
        if path not in self._read:
            try:
                self._read[path] = self._turned(path, read_mesh(path))
            except ModelError as error:
                if "pip install" in str(error):
                    raise
                self._read[path] = error
        found = self._read[path]
        if isinstance(found, ModelError):
            self._missing(kind, link, str(found))
            return []
        return found

    def _turned(self, path: Path, parts: list[Mesh]) -> list[Mesh]:
        if not is_y_up(path):
            return parts
        if self._options.up_axis == "apply":
            return [part.z_up() for part in parts]
        self._report.add(
            "warning",
            "Y_UP of COLLADA files is ignored, as in RViz; if parts look turned, try --up-axis apply",
            path.name,
        )
        return parts

    def _threshold(self, link: str, stem: str) -> float | None:
        if stem in self._by_mesh:
            return self._by_mesh[stem]
        return self._thresholds.get(link, self._thresholds.get(""))

    def _add(
        self, parts: list[Mesh], stem: str, scale: tuple[float, float, float], kind: Kind, threshold: float | None
    ) -> list[Asset]:
        parts = [part.scaled(scale) for part in parts]
        parts = [part for part in parts if len(part.faces)]
        if not parts:
            return []
        if kind == "visual":
            return [self._visual(part, stem) for part in parts]
        mesh = joined([Mesh(part.vertices, part.faces) for part in parts]).merged()
        flat = _flat_box(mesh)
        if flat is not None:
            self._report.add("repair", "flat collision mesh became a box of 1 mm", stem)
            return [Asset("", None, flat)]
        mesh = simplified(mesh, MUJOCO_LIMIT, stem, self._report)
        if len(mesh.faces) > MUJOCO_LIMIT:
            self._missing(kind, stem, f"it has {len(mesh.faces)} triangles; MuJoCo reads at most {MUJOCO_LIMIT}")
            return []
        convex = [mesh] if threshold is None else self._decomposed(mesh, stem, threshold)
        convex = [part for part in convex if _flat_box(part) is None]
        return [Asset(self._save(part, f"{stem}_collision", kind)) for part in convex]

    def _decomposed(self, mesh: Mesh, stem: str, threshold: float) -> list[Mesh]:
        if self._options.decompose == "auto" and stem not in self._by_mesh:
            found = concavity(mesh)
            if found is None or found <= CONCAVE:
                return [mesh]
        parts = self._decomposer.parts(mesh, stem, threshold)
        if len(parts) > 1:
            self._report.add("guess", "collision mesh divided into convex parts", stem, f"{len(parts)} parts")
        return parts

    def _visual(self, mesh: Mesh, stem: str) -> Asset:
        mesh = simplified(mesh, self._options.max_faces, stem, self._report)
        if len(mesh.faces) > MUJOCO_LIMIT and mesh.uv is None:
            mesh = simplified(mesh, MUJOCO_LIMIT, stem, self._report)
        material = None
        if mesh.image is not None:
            material = self._materials.texture(mesh.image, stem)
        elif mesh.rgba is not None:
            material = self._materials.colour(mesh.rgba)
        return Asset(self._save(mesh, stem, "visual"), material)

    def _save(self, mesh: Mesh, stem: str, kind: Kind) -> str:
        content = write_stl(mesh) if mesh.uv is None else write_obj(mesh)
        if content not in self._written:
            file = free_name(stem, self._file_names) + (".stl" if mesh.uv is None else ".obj")
            self.files[file] = content
            self._written[content] = file
        name = free_name(stem, self._names)
        self._meshes.append((name, self._written[content], kind))
        return name


def _flat_box(mesh: Mesh) -> tuple[Array, Array, Array] | None:
    """Returns the box around a flat mesh, 1 mm thick; None if the mesh is not flat."""
    center = mesh.vertices.mean(axis=0)
    axes = np.linalg.svd((mesh.vertices - center).T @ (mesh.vertices - center))[0]
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    inside = (mesh.vertices - center) @ axes
    low, high = inside.min(axis=0), inside.max(axis=0)
    half = (high - low) / 2.0
    if half.min() > _FLAT * half.max() and len(mesh.vertices) >= 4:
        return None
    return center + axes @ ((low + high) / 2.0), axes, np.maximum(half, _MIN_HALF)


def thresholds_of(option: str) -> dict[str, float]:
    """Returns the thresholds by link; that of all links has the empty name."""
    if option == "none":
        return {}
    if option in ("auto", "all"):
        return {"": THRESHOLD}
    pairs = (part.partition("=") for part in option.split(","))
    return {link: float(number) for link, _, number in pairs}
