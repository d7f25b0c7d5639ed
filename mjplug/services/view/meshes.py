"""Meshes, height fields, flexes and skins of a drawing pack."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.services.view.catalogue import numbers
from mjplug.services.view.container import Buffers

_DEFAULT_RGBA = np.array((0.5, 0.5, 0.5, 1.0), np.float32)
"""The colour that MuJoCo gives shapes; with it, the colour of the material counts."""

_BITS = 21
"""Bits of one index in the combined key of a mesh corner; three fit into an int64."""

_SURFACE_DIM = 2
"""Dimension of a flex made of triangles; one of tetrahedra has 3, and its `flex_shell` is its surface."""


def color(model: mujoco.MjModel, own: Any, material: int) -> Any:
    """Returns the colour of a shape, which is that of its material unless it has its own."""
    return model.mat_rgba[material] if material >= 0 and np.array_equal(own, _DEFAULT_RGBA) else own


def mesh(model: mujoco.MjModel, index: int, buffers: Buffers) -> dict[str, Any]:
    """Adds a mesh as an indexed triangle list; returns its entry.

    MuJoCo indexes positions, normals and texture coordinates separately. Each different combination becomes one vertex.
    """
    faces = slice(model.mesh_faceadr[index], model.mesh_faceadr[index] + model.mesh_facenum[index])
    vertex = model.mesh_face[faces].ravel().astype(np.int64)
    normal = model.mesh_facenormal[faces].ravel().astype(np.int64)
    textured = model.mesh_texcoordadr[index] >= 0
    uv = model.mesh_facetexcoord[faces].ravel().astype(np.int64) if textured else np.zeros_like(vertex)
    corners, indices = np.unique((vertex << 2 * _BITS) | (normal << _BITS) | uv, return_inverse=True)
    mask = (1 << _BITS) - 1
    normals = model.mesh_normal[model.mesh_normaladr[index] + ((corners >> _BITS) & mask)]
    entry = {
        "id": index,
        "positions": buffers.array(model.mesh_vert[model.mesh_vertadr[index] + (corners >> 2 * _BITS)]),
        "normals": buffers.array(np.rint(127.0 * normals).astype(np.int8)),
        "indices": buffers.array(smallest(indices, len(corners))),
    }
    if textured:
        entry["uv"] = buffers.array(model.mesh_texcoord[model.mesh_texcoordadr[index] + (corners & mask)])
    return entry


def smallest(indices: NDArray[Any], count: int) -> NDArray[Any]:
    """Returns indices into `count` vertices as uint16, or as uint32 if that is too small."""
    return indices.ravel().astype(np.uint16 if count <= 1 << 16 else np.uint32)


def hfield(model: mujoco.MjModel, index: int, buffers: Buffers) -> dict[str, Any]:
    """Adds a height field; returns its entry. Elevations are 0 to 1, rows from -y to +y."""
    rows, columns = int(model.hfield_nrow[index]), int(model.hfield_ncol[index])
    data = model.hfield_data[model.hfield_adr[index] :][: rows * columns]
    return {
        "id": index,
        "size": numbers(model.hfield_size[index]),
        "elevation": buffers.array(data.reshape(rows, columns)),
    }


def flex(model: mujoco.MjModel, index: int, buffers: Buffers) -> dict[str, Any]:
    """Adds the topology of a flex; the positions of its vertices are in the frames. Returns its entry.

    `uv_elements` contains for each vertex index in `elements` the index of its texture coordinates in `uv`.
    """
    dim, count = int(model.flex_dim[index]), int(model.flex_vertnum[index])
    if dim <= _SURFACE_DIM:
        start, number = model.flex_elemdataadr[index], model.flex_elemnum[index] * (dim + 1)
        elements = model.flex_elem[start : start + number].reshape(-1, dim + 1)
        corners = model.flex_elemtexcoord[start : start + number].reshape(-1, dim + 1)
    else:
        start, number = model.flex_shelldataadr[index], model.flex_shellnum[index] * dim
        elements = corners = model.flex_shell[start : start + number].reshape(-1, dim)
    entry = {
        "id": index,
        "dim": dim,
        "first_vertex": int(model.flex_vertadr[index]),
        "vertices": count,
        "elements": buffers.array(smallest(elements, count).reshape(elements.shape)),
        "radius": float(model.flex_radius[index]),
        "rgba": numbers(color(model, model.flex_rgba[index], int(model.flex_matid[index]))),
        "material": int(model.flex_matid[index]),
        "group": int(model.flex_group[index]),
        "flat": bool(model.flex_flatskin[index]),
    }
    if model.flex_texcoordadr[index] >= 0 and dim >= _SURFACE_DIM:
        coordinates = int(corners.max()) + 1
        entry["uv"] = buffers.array(model.flex_texcoord[model.flex_texcoordadr[index] :][:coordinates])
        entry["uv_elements"] = buffers.array(smallest(corners, coordinates).reshape(corners.shape))
    return entry


def skin(model: mujoco.MjModel, index: int, buffers: Buffers) -> dict[str, Any]:
    """Adds a skin and its bones; returns its entry."""
    first, count = model.skin_vertadr[index], model.skin_vertnum[index]
    face, faces = model.skin_faceadr[index], model.skin_facenum[index]
    entry = {
        "id": index,
        "positions": buffers.array(model.skin_vert[first : first + count]),
        "indices": buffers.array(smallest(model.skin_face[face : face + faces], int(count))),
        "inflate": float(model.skin_inflate[index]),
        "rgba": numbers(color(model, model.skin_rgba[index], int(model.skin_matid[index]))),
        "material": int(model.skin_matid[index]),
        "group": int(model.skin_group[index]),
        "bones": [],
    }
    if model.skin_texcoordadr[index] >= 0:
        entry["uv"] = buffers.array(model.skin_texcoord[model.skin_texcoordadr[index] :][:count])
    for bone in range(model.skin_boneadr[index], model.skin_boneadr[index] + model.skin_bonenum[index]):
        held = slice(model.skin_bonevertadr[bone], model.skin_bonevertadr[bone] + model.skin_bonevertnum[bone])
        entry["bones"].append(
            {
                "body": int(model.skin_bonebodyid[bone]),
                "pos": numbers(model.skin_bonebindpos[bone]),
                "quat": numbers(model.skin_bonebindquat[bone]),
                "vertices": buffers.array(smallest(model.skin_bonevertid[held], int(count))),
                "weights": buffers.array(model.skin_bonevertweight[held]),
            }
        )
    return entry
