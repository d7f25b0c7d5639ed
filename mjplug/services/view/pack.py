"""The drawing pack: everything that a client without MuJoCo needs to draw a model, except the poses."""

from typing import Any, Literal

import mujoco

from mjplug.services.view import meshes, png
from mjplug.services.view.catalogue import catalogue, names, numbers
from mjplug.services.view.container import Buffers
from mjplug.services.view.moving import moving_bodies

_OBJ = mujoco.mjtObj
_GEOMS = {int(kind): name.removeprefix("mjGEOM_").lower() for name, kind in mujoco.mjtGeom.__members__.items()}
_LIGHTS = {int(kind): name.removeprefix("mjLIGHT_").lower() for name, kind in mujoco.mjtLightType.__members__.items()}
_LIGHT_MODES = {
    int(mode): name.removeprefix("mjCAMLIGHT_").lower() for name, mode in mujoco.mjtCamLight.__members__.items()
}
_TEXTURES = {int(kind): name.removeprefix("mjTEXTURE_").lower() for name, kind in mujoco.mjtTexture.__members__.items()}
_MESH_TYPES = (int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_SDF))
_HFIELD = int(mujoco.mjtGeom.mjGEOM_HFIELD)


def build(model: mujoco.MjModel) -> bytes:
    """Returns the drawing pack of a model, uncompressed; see `container.Buffers.pack` for the format.

    Lengths are in m, orientations are quaternions with w first. Poses of geoms, sites, cameras and lights are relative
    to their body. Geoms that are completely transparent and meshes that no geom uses are left out.
    """
    buffers = Buffers()
    geoms, sites = _geoms(model), _sites(model)
    used = {kind: sorted({geom[kind] for geom in geoms if kind in geom}) for kind in ("mesh", "hfield")}
    return buffers.pack(
        {
            # The name of the model is the first of all names.
            "name": model.names.partition(b"\0")[0].decode(),
            "mujoco": mujoco.__version__,
            **catalogue(model),
            "bodies": _bodies(model),
            "moving": moving_bodies(model).tolist(),
            "geoms": geoms,
            "sites": sites,
            "cameras": _cameras(model),
            "lights": _lights(model),
            "materials": _materials(model),
            "textures": [_texture(model, index, buffers) for index in range(model.ntex)],
            "meshes": [meshes.mesh(model, index, buffers) for index in used["mesh"]],
            "hfields": [meshes.hfield(model, index, buffers) for index in used["hfield"]],
            "flexes": [meshes.flex(model, index, buffers) for index in range(model.nflex)],
            "skins": [meshes.skin(model, index, buffers) for index in range(model.nskin)],
            "vis": {group: _fields(getattr(model.vis, attribute)) for group, attribute in _VIS.items()},
            "stat": _fields(model.stat),
        }
    )


_VIS = {"global": "global_", "headlight": "headlight", "map": "map", "scale": "scale", "rgba": "rgba"}


def _fields(section: Any) -> dict[str, Any]:
    return {name: numbers(getattr(section, name)) for name in dir(section) if not name.startswith("_")}


def _bodies(model: mujoco.MjModel) -> list[dict[str, Any]]:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return [
        {
            "name": name,
            "parent": int(model.body_parentid[body]),
            "root": int(model.body_rootid[body]),
            "pos": numbers(data.xpos[body]),
            "quat": numbers(data.xquat[body]),
            "mass": float(model.body_mass[body]),
            "mocap": bool(model.body_mocapid[body] >= 0),
        }
        for body, name in enumerate(names(model, _OBJ.mjOBJ_BODY, model.nbody))
    ]


def _geoms(model: mujoco.MjModel) -> list[dict[str, Any]]:
    entries = []
    for geom, name in enumerate(names(model, _OBJ.mjOBJ_GEOM, model.ngeom)):
        if meshes.color(model, model.geom_rgba[geom], int(model.geom_matid[geom]))[3] <= 0.0:
            continue
        entry = _shape(model, "geom", geom, name)
        kind, data = int(model.geom_type[geom]), int(model.geom_dataid[geom])
        if data >= 0 and kind in _MESH_TYPES:
            entry["mesh"] = data
        elif data >= 0 and kind == _HFIELD:
            entry["hfield"] = data
        entries.append(entry)
    return entries


def _sites(model: mujoco.MjModel) -> list[dict[str, Any]]:
    found = names(model, _OBJ.mjOBJ_SITE, model.nsite)
    return [_shape(model, "site", site, name) for site, name in enumerate(found)]


def _shape(model: mujoco.MjModel, kind: Literal["geom", "site"], index: int, name: str) -> dict[str, Any]:
    """Returns what geoms and sites have in common."""

    def value(field: str) -> Any:
        return getattr(model, f"{kind}_{field}")[index]

    material = int(value("matid"))
    return {
        "id": index,
        "name": name,
        "body": int(value("bodyid")),
        "type": _GEOMS[int(value("type"))],
        "size": numbers(value("size")),
        "pos": numbers(value("pos")),
        "quat": numbers(value("quat")),
        "rgba": numbers(meshes.color(model, value("rgba"), material)),
        "material": material,
        "group": int(value("group")),
    }


def _cameras(model: mujoco.MjModel) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "body": int(model.cam_bodyid[camera]),
            "fovy": float(model.cam_fovy[camera]),
            "resolution": numbers(model.cam_resolution[camera]),
            "sensorsize": numbers(model.cam_sensorsize[camera]),
            "intrinsic": numbers(model.cam_intrinsic[camera]),
        }
        for camera, name in enumerate(names(model, _OBJ.mjOBJ_CAMERA, model.ncam))
    ]


def _lights(model: mujoco.MjModel) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "body": int(model.light_bodyid[light]),
            "type": _LIGHTS[int(model.light_type[light])],
            "mode": _LIGHT_MODES[int(model.light_mode[light])],
            "target": int(model.light_targetbodyid[light]),
            "pos": numbers(model.light_pos[light]),
            "dir": numbers(model.light_dir[light]),
            "pos0": numbers(model.light_pos0[light]),
            "dir0": numbers(model.light_dir0[light]),
            "active": bool(model.light_active[light]),
            "castshadow": bool(model.light_castshadow[light]),
            "attenuation": numbers(model.light_attenuation[light]),
            "cutoff": float(model.light_cutoff[light]),
            "exponent": float(model.light_exponent[light]),
            "ambient": numbers(model.light_ambient[light]),
            "diffuse": numbers(model.light_diffuse[light]),
            "specular": numbers(model.light_specular[light]),
        }
        for light, name in enumerate(names(model, _OBJ.mjOBJ_LIGHT, model.nlight))
    ]


def _materials(model: mujoco.MjModel) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "rgba": numbers(model.mat_rgba[material]),
            "emission": float(model.mat_emission[material]),
            "specular": float(model.mat_specular[material]),
            "shininess": float(model.mat_shininess[material]),
            "reflectance": float(model.mat_reflectance[material]),
            "texture": _color_texture(model, material),
            "texrepeat": numbers(model.mat_texrepeat[material]),
            "texuniform": bool(model.mat_texuniform[material]),
        }
        for material, name in enumerate(names(model, _OBJ.mjOBJ_MATERIAL, model.nmat))
    ]


def _color_texture(model: mujoco.MjModel, material: int) -> int:
    """Returns the index of a material's colour texture; -1 if it has none."""
    role = mujoco.mjtTextureRole
    roles = (int(role.mjTEXROLE_RGB), int(role.mjTEXROLE_RGBA))
    return max(int(model.mat_texid[material][index]) for index in roles)


def _texture(model: mujoco.MjModel, index: int, buffers: Buffers) -> dict[str, Any]:
    shape = tuple(int(a[index]) for a in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[index])
    pixels = model.tex_data[start : start + shape[0] * shape[1] * shape[2]].reshape(shape)
    return {
        "name": names(model, _OBJ.mjOBJ_TEXTURE, index + 1)[index],
        "type": _TEXTURES[int(model.tex_type[index])],
        "width": shape[1],
        "height": shape[0],
        "srgb": _is_srgb(model, index),
        "png": buffers.file(png.encode(pixels)),
    }


def _is_srgb(model: mujoco.MjModel, index: int) -> bool:
    return int(model.tex_colorspace[index]) == int(mujoco.mjtColorSpace.mjCOLORSPACE_SRGB)
