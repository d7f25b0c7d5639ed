"""Triangle meshes in memory, and their files: STL and OBJ are read here, other formats with trimesh."""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug.convert.collada import meters, read_collada, resolver_of
from mjplug.convert.extras import optional, required
from mjplug.convert.rotations import Array
from mjplug.errors import ModelError

Faces = NDArray[np.int64]

_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEADER = 84
_SCENES = (".dae", ".ply", ".glb", ".gltf", ".3mf", ".off", ".x3d")


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles of one colour.

    Attributes:
        vertices: Corners, shape (n, 3) [m].
        faces: Indices of corners, shape (m, 3).
        rgba: The colour in the file, each part from 0 to 1; None if the file contains none.
        uv: Texture coordinates of the corners, shape (n, 2); None without a texture.
        image: The texture, an image of Pillow.
    """

    vertices: Array
    faces: Faces
    rgba: tuple[float, ...] | None = None
    uv: Array | None = None
    image: Any = None

    def scaled(self, scale: tuple[float, float, float]) -> "Mesh":
        """Returns the mesh with its axes scaled. A mirroring scale reverses the corners of each face."""
        mirrored = np.prod(scale) < 0.0
        return replace(self, vertices=self.vertices * scale, faces=self.faces[:, ::-1] if mirrored else self.faces)

    def z_up(self) -> "Mesh":
        """Returns the mesh of a file whose y axis is up, turned so that its z axis is up."""
        x, y, z = self.vertices.T
        return replace(self, vertices=np.stack([x, -z, y], axis=1))

    def merged(self) -> "Mesh":
        """Returns the mesh with one corner where several have the same place, without the faces that become lines."""
        if self.uv is not None:
            return self
        vertices, index = np.unique(self.vertices, axis=0, return_inverse=True)
        faces = index.reshape(-1)[self.faces]
        a, b, c = faces.T
        return replace(self, vertices=vertices, faces=faces[(a != b) & (b != c) & (c != a)])

    def extents(self) -> Array:
        """Returns the lengths of the mesh along its principal axes, the longest first, shape (3,) [m]."""
        center = self.vertices - self.vertices.mean(axis=0)
        axes = np.linalg.svd(center.T @ center)[0]
        return np.asarray(np.ptp(center @ axes, axis=0))


def read_mesh(path: Path) -> list[Mesh]:
    """Returns the parts of a mesh file, one for each colour.

    Args:
        path: The file. The unit of a COLLADA file is applied; its `up_axis` is ignored, as RViz does.

    Raises:
        ModelError: The file cannot be read, contains no triangles, or needs a library that is not installed.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".stl":
            parts = [_read_stl(path)]
        elif suffix == ".obj" and not _coloured(path):
            parts = [_read_obj(path)]
        elif suffix in (*_SCENES, ".obj"):
            parts = _read_scene(path)
        else:
            known = ", ".join((".stl", ".obj", *_SCENES))
            raise ModelError(
                f"{path.name}: the mesh format {suffix or 'without a suffix'} is not supported; known: {known}"
            )
    except OSError as error:
        raise ModelError(f"{path.name} cannot be read: {error.strerror or error}") from error
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise ModelError(f"{path.name} contains no triangles")
    if any(not np.isfinite(part.vertices).all() for part in parts):
        raise ModelError(f"{path.name} contains coordinates that are infinite or not a number")
    return parts


def write_stl(mesh: Mesh) -> bytes:
    """Returns a binary STL."""
    triangles = np.zeros(len(mesh.faces), _STL_TRIANGLE)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    triangles["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    triangles["corners"] = corners
    return bytes(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes()


def write_obj(mesh: Mesh) -> bytes:
    """Returns an OBJ with texture coordinates."""
    assert mesh.uv is not None
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"vt {u:.6g} {v:.6g}" for u, v in mesh.uv.tolist()]
    lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def _read_stl(path: Path) -> Mesh:
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEADER else -1
    if count >= 0 and len(data) >= _STL_HEADER + count * _STL_TRIANGLE.itemsize and count:
        corners = np.frombuffer(data, _STL_TRIANGLE, count, _STL_HEADER)["corners"].astype(float)
    else:
        words = data.split()
        at = [i for i, word in enumerate(words) if word == b"vertex"]
        try:
            corners = np.array([[float(value) for value in words[i + 1 : i + 4]] for i in at]).reshape(-1, 3, 3)
        except ValueError:
            raise ModelError(f"{path.name} is a damaged STL file") from None
        if not len(corners):
            raise ModelError(f"{path.name} is not an STL file, or contains no triangles")
    vertices = corners.reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3)).merged()


def _coloured(path: Path) -> bool:
    """Returns whether trimesh must read an OBJ: it has materials, and trimesh is installed."""
    with path.open("rb") as file:
        uses = any(line.startswith((b"mtllib", b"usemtl")) for line in file)
    return uses and optional("trimesh") is not None


def _read_obj(path: Path) -> Mesh:
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                vertices.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                corners = [int(word.partition("/")[0]) for word in words[1:]]
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                faces += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
        points = np.array(vertices, dtype=float).reshape(-1, 3)
        indices = np.array(faces, dtype=np.int64).reshape(-1, 3)
    except ValueError:
        raise ModelError(f"{path.name} is a damaged OBJ file") from None
    if len(indices) and not (indices.min() >= 0 and indices.max() < len(points)):
        raise ModelError(f"{path.name} is a damaged OBJ file: a face names a vertex that does not exist")
    return Mesh(points, indices).merged()


def _read_scene(path: Path) -> list[Mesh]:
    what = f"the mesh {path.name}"
    trimesh = required("trimesh", what)
    if path.suffix.lower() == ".dae":
        required("collada", what)
    required("PIL.Image", what)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if path.suffix.lower() == ".dae":
                scene = read_collada(path)
            else:
                scene = trimesh.load_scene(path, resolver=resolver_of(path), process=False)
        except OSError:
            raise
        except Exception as error:  # the readers raise whatever they meet in a damaged file
            raise ModelError(
                f"{path.name} cannot be read: {' '.join(str(error).split()) or type(error).__name__}"
            ) from error
    unit = meters(scene.units) if path.suffix.lower() == ".dae" else 1.0
    parts: list[Mesh] = []
    for node in sorted(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or not len(geometry.faces):
            continue
        vertices = (np.asarray(geometry.vertices) @ transform[:3, :3].T + transform[:3, 3]) * unit
        faces = np.asarray(geometry.faces, dtype=np.int64)
        if np.linalg.det(transform[:3, :3]) < 0.0:
            faces = faces[:, ::-1]
        parts.append(_with_material(Mesh(vertices, faces), geometry.visual))
    return _joined(parts)


def _with_material(mesh: Mesh, visual: Any) -> Mesh:
    """Adds the colour and texture that trimesh has found."""
    material = getattr(visual, "material", None)
    if material is not None:
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        uv = getattr(visual, "uv", None)
        if image is not None and uv is not None and len(uv) == len(mesh.vertices):
            return replace(mesh, uv=np.asarray(uv, dtype=float)[:, :2], image=image)
        colour = material.main_color
    elif getattr(visual, "kind", None) in ("vertex", "face"):
        colour = np.mean(visual.vertex_colors if visual.kind == "vertex" else visual.face_colors, axis=0)
    else:
        return mesh.merged()
    rgba = [round(float(value) / 255.0, 4) for value in colour]
    # Some files have an alpha of zero where they mean opaque.
    rgba[3] = rgba[3] or 1.0
    return replace(mesh, rgba=tuple(rgba)).merged()


def _joined(parts: list[Mesh]) -> list[Mesh]:
    """Joins the parts that have the same colour."""
    groups: dict[object, list[Mesh]] = {}
    for part in parts:
        groups.setdefault(part.rgba if part.image is None else id(part.image), []).append(part)
    return [joined(group) for group in groups.values()]


def joined(parts: list[Mesh]) -> Mesh:
    """Returns one mesh with the faces of all, and the colour of the first."""
    if len(parts) == 1:
        return parts[0]
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    uvs = [part.uv for part in parts if part.uv is not None]
    return replace(
        parts[0],
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
        uv=np.concatenate(uvs) if len(uvs) == len(parts) else None,
    )
