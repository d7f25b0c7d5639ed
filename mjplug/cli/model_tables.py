"""The elements of a model as tables; the first row contains the names of the columns."""

from collections.abc import Callable
from typing import Any

import mujoco

Table = list[list[Any]]


def counts(model: mujoco.MjModel) -> dict[str, Any]:
    """Returns the time step [s], the mass [kg] and the number of elements of a model."""
    return {
        "timestep": float(model.opt.timestep),
        "mass": float(model.body_subtreemass[0]),
        "nq": model.nq,
        "nv": model.nv,
        "nu": model.nu,
        "bodies": model.nbody - 1,
        "joints": model.njnt,
        "geoms": model.ngeom,
        "sites": model.nsite,
        "cameras": model.ncam,
        "sensors": model.nsensor,
        "keyframes": model.nkey,
        "equality constraints": model.neq,
        "tendons": model.ntendon,
    }


def _bodies(model: mujoco.MjModel) -> Table:
    rows: Table = [["name", "parent", "joints", "mass", "position"]]
    for i in range(1, model.nbody):
        body = model.body(i)
        rows.append(
            [
                _name(body.name, i),
                _name(model.body(model.body_parentid[i]).name, int(model.body_parentid[i])),
                ", ".join(_name(model.joint(j).name, j) for j in _joints_of(model, i)) or "-",
                float(model.body_mass[i]),
                _numbers(model.body_pos[i]),
            ]
        )
    return rows


def _joints(model: mujoco.MjModel) -> Table:
    rows: Table = [["name", "type", "body", "range", "qpos", "qvel"]]
    for i in range(model.njnt):
        kind = mujoco.mjtJoint(model.jnt_type[i]).name.removeprefix("mjJNT_").lower()
        rows.append(
            [
                _name(model.joint(i).name, i),
                kind,
                _name(model.body(model.jnt_bodyid[i]).name, int(model.jnt_bodyid[i])),
                _numbers(model.jnt_range[i]) if model.jnt_limited[i] else "-",
                int(model.jnt_qposadr[i]),
                int(model.jnt_dofadr[i]),
            ]
        )
    return rows


def _actuators(model: mujoco.MjModel) -> Table:
    rows: Table = [["name", "acts on", "target", "control range", "gear"]]
    for i in range(model.nu):
        kind = mujoco.mjtTrn(model.actuator_trntype[i])
        rows.append(
            [
                _name(model.actuator(i).name, i),
                kind.name.removeprefix("mjTRN_").lower(),
                _target(model, kind, int(model.actuator_trnid[i][0])),
                _numbers(model.actuator_ctrlrange[i]) if model.actuator_ctrllimited[i] else "-",
                float(model.actuator_gear[i][0]),
            ]
        )
    return rows


def _sensors(model: mujoco.MjModel) -> Table:
    rows: Table = [["name", "type", "values", "of"]]
    for i in range(model.nsensor):
        of = int(model.sensor_objtype[i])
        rows.append(
            [
                _name(model.sensor(i).name, i),
                mujoco.mjtSensor(model.sensor_type[i]).name.removeprefix("mjSENS_").lower(),
                int(model.sensor_dim[i]),
                mujoco.mj_id2name(model, of, int(model.sensor_objid[i])) or "-",
            ]
        )
    return rows


def _sites(model: mujoco.MjModel) -> Table:
    return [
        ["name", "body", "position"],
        *(
            [
                _name(model.site(i).name, i),
                _name(model.body(model.site_bodyid[i]).name, int(model.site_bodyid[i])),
                _numbers(model.site_pos[i]),
            ]
            for i in range(model.nsite)
        ),
    ]


def _cameras(model: mujoco.MjModel) -> Table:
    return [
        ["name", "body", "field of view", "position"],
        *(
            [
                _name(model.camera(i).name, i),
                _name(model.body(model.cam_bodyid[i]).name, int(model.cam_bodyid[i])),
                float(model.cam_fovy[i]),
                _numbers(model.cam_pos[i]),
            ]
            for i in range(model.ncam)
        ),
    ]


def _keyframes(model: mujoco.MjModel) -> Table:
    return [
        ["name", "index", "time"],
        *([_name(model.key(i).name, i), i, float(model.key_time[i])] for i in range(model.nkey)),
    ]


TABLES: dict[str, Callable[[mujoco.MjModel], Table]] = {
    "bodies": _bodies,
    "joints": _joints,
    "actuators": _actuators,
    "sensors": _sensors,
    "sites": _sites,
    "cameras": _cameras,
    "keyframes": _keyframes,
}
"""The functions that return the tables, by kind of element."""


def _joints_of(model: mujoco.MjModel, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body])) if first >= 0 else range(0)


def _target(model: mujoco.MjModel, kind: mujoco.mjtTrn, index: int) -> str:
    objects = {
        mujoco.mjtTrn.mjTRN_JOINT: mujoco.mjtObj.mjOBJ_JOINT,
        mujoco.mjtTrn.mjTRN_JOINTINPARENT: mujoco.mjtObj.mjOBJ_JOINT,
        mujoco.mjtTrn.mjTRN_SLIDERCRANK: mujoco.mjtObj.mjOBJ_SITE,
        mujoco.mjtTrn.mjTRN_SITE: mujoco.mjtObj.mjOBJ_SITE,
        mujoco.mjtTrn.mjTRN_TENDON: mujoco.mjtObj.mjOBJ_TENDON,
        mujoco.mjtTrn.mjTRN_BODY: mujoco.mjtObj.mjOBJ_BODY,
    }
    name = mujoco.mj_id2name(model, objects[kind], index) if kind in objects else None
    return _name(name or "", index)


def _name(name: str, index: int) -> str:
    """Returns the name of an element, or its index in brackets if it has no name."""
    return name or f"[{index}]"


def _numbers(values: Any) -> list[float]:
    return [float(value) for value in values]
