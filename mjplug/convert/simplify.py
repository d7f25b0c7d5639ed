"""Meshes with fewer triangles."""

from dataclasses import replace

import numpy as np

from mjplug.convert.extras import optional
from mjplug.convert.mesh import Mesh
from mjplug.convert.report import Report

MUJOCO_LIMIT = 200_000
"""Largest number of triangles in an STL that MuJoCo reads."""


def simplified(mesh: Mesh, limit: int, name: str, report: Report) -> Mesh:
    """Returns the mesh with at most about `limit` triangles; 0 means no limit.

    A mesh with a texture, and any mesh if `fast_simplification` is not installed, is returned unchanged.
    """
    if not limit or len(mesh.faces) <= limit:
        return mesh
    library = optional("fast_simplification")
    if mesh.uv is not None:
        report.add("warning", "large mesh with a texture is not simplified", name, f"{len(mesh.faces)} triangles")
        return mesh
    if library is None:
        report.add(
            "warning", "large mesh; pip install 'mjplug[convert]' simplifies it", name, f"{len(mesh.faces)} triangles"
        )
        return mesh
    mesh = mesh.merged()
    vertices, faces = library.simplify(
        np.ascontiguousarray(mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(mesh.faces, dtype=np.int32),
        target_count=limit,
    )
    if len(faces) < 4:
        return mesh
    report.add("guess", "mesh simplified (--max-faces)", name, f"{len(mesh.faces)} -> {len(faces)} triangles")
    return replace(mesh, vertices=np.asarray(vertices, dtype=float), faces=np.asarray(faces, dtype=np.int64))
