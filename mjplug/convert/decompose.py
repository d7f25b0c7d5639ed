"""Divides a concave collision mesh into convex parts with CoACD, in a child process with a time limit."""

import hashlib
import io
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mjplug.convert.extras import DECOMPOSE, required
from mjplug.convert.mesh import Mesh
from mjplug.convert.report import Report
from mjplug.convert.simplify import simplified

TIME_LIMIT = 60
"""Largest processor time for one mesh [s]. Unlike wall time, it gives the same result on a busy machine."""

_WALL_FACTOR = 10
"""Wall time after which a mesh is given up, as a multiple of the processor time; on Windows the only limit."""

FACES = 2000
"""Triangles that remain before the decomposition: the time grows faster than their number."""

THRESHOLD, MAX_PARTS = 0.1, 16

_KILLED = tuple(-int(getattr(signal, name)) for name in ("SIGXCPU", "SIGKILL") if hasattr(signal, name))
CONCAVE = 1.3
"""`auto` divides a mesh whose hull has more than this times its volume."""

_CHILD = """
import io, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[1]), int(sys.argv[1])))
except ImportError:
    pass
import numpy as np, coacd
data = np.load(io.BytesIO(sys.stdin.buffer.read()))
coacd.set_log_level("error")
parts = coacd.run_coacd(
    coacd.Mesh(data["vertices"], data["faces"]), threshold=float(data["threshold"]), max_convex_hull=int(data["parts"]),
    seed=0,
)
arrays = {}
for i, (vertices, faces) in enumerate(parts):
    arrays[f"v{i}"], arrays[f"f{i}"] = vertices, faces
output = io.BytesIO()
np.savez(output, **arrays)
sys.stdout.buffer.write(output.getvalue())
"""


@dataclass(frozen=True, slots=True)
class Decomposer:
    """Decomposes meshes, and keeps the results in a cache.

    Attributes:
        cache: Folder of the cache; None for none.
        report: The report.
        time_limit: Largest processor time for one mesh [s].
    """

    cache: Path | None
    report: Report
    time_limit: int = TIME_LIMIT

    def parts(self, mesh: Mesh, name: str, threshold: float = THRESHOLD) -> list[Mesh]:
        """Returns convex parts of a mesh; the mesh itself if the time limit is exceeded or CoACD fails.

        Raises:
            ModelError: CoACD is not installed.
        """
        library = required("coacd", "the decomposition of meshes", DECOMPOSE)
        mesh = simplified(mesh, FACES, name, Report())
        vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int32)
        version = getattr(library, "__version__", "")
        settings = f"{threshold} {MAX_PARTS} {version}".encode()
        digest = hashlib.blake2b(vertices.tobytes() + faces.tobytes() + settings, digest_size=16).hexdigest()
        file = None if self.cache is None else self.cache / f"{digest}.npz"
        if file is not None and file.is_file():
            return _unpacked(file.read_bytes())
        request = io.BytesIO()
        np.savez(request, vertices=vertices, faces=faces, threshold=threshold, parts=MAX_PARTS)
        try:
            done = subprocess.run(
                [sys.executable, "-c", _CHILD, str(self.time_limit)],
                input=request.getvalue(),
                capture_output=True,
                timeout=_WALL_FACTOR * self.time_limit,
                check=False,
            )
        except subprocess.TimeoutExpired:
            done = None
        if done is None or done.returncode in _KILLED:
            self.report.add("warning", f"decomposition takes over {self.time_limit} s; the convex hull is used", name)
            return [mesh]
        if done.returncode or not done.stdout:
            reason = done.stderr.decode(errors="replace").strip().splitlines()
            self.report.add(
                "warning", "decomposition failed; the convex hull is used", name, (reason or ["no result"])[-1]
            )
            return [mesh]
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            beside = file.with_name(f"{file.name}.{os.getpid()}")
            beside.write_bytes(done.stdout)
            beside.replace(file)
        return _unpacked(done.stdout)


def concavity(mesh: Mesh) -> float | None:
    """Returns the volume of the convex hull divided by that of the mesh; None if the mesh is not closed."""
    import mujoco  # noqa: PLC0415 - only decompositions need it here

    mesh = mesh.merged()
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    corners = mesh.vertices[mesh.faces]
    volume = abs(float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum())) / 6.0
    if np.any(counts % 2) or volume <= 0.0:
        return None
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", uservert=mesh.vertices.reshape(-1), userface=mesh.faces.reshape(-1))
    spec.meshes[0].inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    spec.worldbody.add_body().add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m", density=1.0)
    try:
        return float(spec.compile().body_mass[1]) / volume
    except ValueError:
        return None


def _unpacked(content: bytes) -> list[Mesh]:
    with np.load(io.BytesIO(content)) as arrays:
        count = len(arrays.files) // 2
        return [Mesh(arrays[f"v{i}"].astype(float), arrays[f"f{i}"].astype(np.int64)) for i in range(count)]
