"""Small robots for tests, and their conversion."""

from pathlib import Path

import mujoco
import numpy as np

from mjplug.convert.conversion import convert
from mjplug.convert.options import ConversionOptions
from mjplug.convert.source import read_source
from mjplug.model.packages import Packages

BALL = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


def link(name, mass=1.0, shape="", visual="", inertia=BALL, at="0 0 0"):
    inertial = f'<inertial><origin xyz="{at}"/><mass value="{mass}"/>{inertia}</inertial>' if mass else ""
    seen = f"<visual><geometry>{visual}</geometry></visual>" if visual else ""
    solid = f"<collision><geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{inertial}{seen}{solid}</link>'


def joint(
    name, parent, child, kind="revolute", xyz="0 0 0", axis="0 1 0", limit='lower="-2" upper="2"', more="", rpy="0 0 0"
):
    limits = f'<limit {limit} effort="20" velocity="3"/>' if kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limits}{more}</joint>'
    )


def robot(*parts, name="test"):
    return f'<robot name="{name}">{"".join(parts)}</robot>'


BOX = '<box size="0.1 0.1 0.1"/>'

ARM = robot(
    link("base", shape='<cylinder radius="0.1" length="0.1"/>'),
    link("upper", 2.0, shape='<box size="0.05 0.05 0.3"/>', visual='<box size="0.05 0.05 0.3"/>', at="0 0 0.15"),
    link("lower", 1.0, shape='<box size="0.05 0.05 0.2"/>', at="0.02 0 0.1"),
    link("tool0", 0.0),
    joint("shoulder", "base", "upper", xyz="0 0 0.1", rpy="0 0 0.3"),
    joint("elbow", "upper", "lower", xyz="0 0 0.35", rpy="0.1 0.2 0.3", axis="0 0.6 0.8"),
    joint("tool", "lower", "tool0", "fixed", xyz="0 0 0.25", rpy="1.2 0 0"),
    name="arm",
)

WHEEL = '<cylinder radius="0.1" length="0.04"/>'


def tensor(*moments):
    parts = (f'{name}="{value}"' for name, value in zip(("ixx", "iyy", "izz"), moments, strict=True))
    return f'<inertia {" ".join(parts)} ixy="0" ixz="0" iyz="0"/>'


def wheel(side, y):
    name, turn = f"{side}_wheel", "-1.5707963267948966 0 0"
    return (
        link(name, 0.5, shape=WHEEL, inertia=tensor(0.002, 0.002, 0.003)),
        joint(f"{side}_joint", "base_link", name, "continuous", xyz=f"0.1 {y} 0", rpy=turn, axis="0 0 1"),
    )


ROVER = robot(
    link("base_link", 5.0, shape='<box size="0.4 0.3 0.1"/>', inertia=tensor(0.05, 0.08, 0.1)),
    link("caster", 0.2, shape='<sphere radius="0.05"/>'),
    joint("caster_joint", "base_link", "caster", "fixed", xyz="-0.15 0 -0.05"),
    *wheel("left", 0.2),
    *wheel("right", -0.2),
    name="rover",
)


def converted(folder: Path, text: str, environ=None, **options):
    """Returns the conversion of a URDF, and its compiled scene."""
    file = folder / "robot.urdf"
    file.write_text(text)
    return converted_file(file, environ, **options)


def converted_file(file, environ=None, **options):
    chosen = ConversionOptions(**options)
    given = {name: Path(where) for name, where in chosen.packages.items()}
    packages = Packages(environ or {}, file.parent, given)
    conversion = convert(read_source(file, chosen.arguments, packages), chosen, packages)
    return conversion, model_of(conversion)


def model_of(conversion):
    return mujoco.MjModel.from_xml_string(conversion.files["scene.xml"].decode(), dict(conversion.files))


def angle(path):
    """Writes a concave OBJ: an angle iron."""
    corners = [(x, y, z) for x, y in ((0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)) for z in (0, 0.5)]
    sides = [
        face
        for i in range(6)
        for face in ((2 * i, (2 * i + 2) % 12, (2 * i + 3) % 12), (2 * i, (2 * i + 3) % 12, 2 * i + 1))
    ]
    caps = [(0, 3), (3, 4), (4, 5)]
    floor = [(0, 2 * b, 2 * a) for a, b in [(1, 2), (2, 3), *caps[1:]]]
    roof = [(1, 2 * a + 1, 2 * b + 1) for a, b in [(1, 2), (2, 3), *caps[1:]]]
    lines = [
        *(f"v {x} {y} {z}" for x, y, z in corners),
        *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in sides + floor + roof),
    ]
    path.write_text("\n".join(lines))


def at_home(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    return data


def notes(conversion, *kinds):
    return [(note.topic, note.subject) for note in conversion.report.of(*kinds)]


def rotation(rpy):
    """Returns a rotation matrix from elementary rotations, independently of the converter."""
    result = np.eye(3)
    for axis, angle in zip("xyz", rpy, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        turn = {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }
        result = np.array(turn[axis]) @ result
    return result
