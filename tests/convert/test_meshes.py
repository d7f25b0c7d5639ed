"""Meshes and materials: every format, unit and fault of real robots."""

import re
import struct
import sys

import numpy as np
import pytest
from model_files import tetrahedron

from convert.robots import BOX, angle, converted, joint, link, notes, robot
from mjplug.convert.decompose import Decomposer
from mjplug.convert.mesh import Mesh, read_mesh
from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.report import Report
from mjplug.errors import ModelError
from mjplug.model.packages import Packages

CUBE = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FACES = [
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
]  # fmt: skip


def mesh(filename, scale="1 1 1"):
    return f'<mesh filename="{filename}" scale="{scale}"/>'


def one_mesh(tmp_path, filename, scale="1 1 1", visual=True, **options):
    geometry = mesh(filename, scale)
    text = robot(
        link("base", shape=BOX),
        link("a", visual=geometry if visual else "", shape="" if visual else geometry),
        joint("j", "base", "a", xyz="0 0 3"),
    )
    return converted(tmp_path, text, **options)


def extents(model, index=0):
    start, count = model.mesh_vertadr[index], model.mesh_vertnum[index]
    return np.ptp(model.mesh_vert[start : start + count], axis=0)


def collada(unit, up="Z_UP", colours=((1, 0, 0, 1),)):
    """Returns a cube in units of `unit` metres; its faces have the colours in turn."""
    positions = " ".join(str(value) for corner in CUBE for value in corner)
    effects = "".join(
        f'<effect id="e{i}"><profile_COMMON><technique sid="t"><lambert><diffuse>'
        f"<color>{' '.join(map(str, rgba))}</color></diffuse></lambert></technique></profile_COMMON></effect>"
        for i, rgba in enumerate(colours)
    )
    materials = "".join(f'<material id="m{i}"><instance_effect url="#e{i}"/></material>' for i in range(len(colours)))
    triangles, bindings = "", ""
    for i in range(len(colours)):
        chosen = FACES[i :: len(colours)]
        indices = " ".join(str(index) for face in chosen for index in face)
        triangles += (
            f'<triangles material="s{i}" count="{len(chosen)}"><input semantic="VERTEX" source="#v" offset="0"/>'
        )
        triangles += f"<p>{indices}</p></triangles>"
        bindings += f'<instance_material symbol="s{i}" target="#m{i}"/>'
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>
<library_effects>{effects}</library_effects><library_materials>{materials}</library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">{positions}</float_array>
<technique_common>
<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{triangles}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"><bind_material>
<technique_common>{bindings}
</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize(("unit", "size"), [(1, 1.0), (0.001, 0.001), (0.0254, 0.0254)])
def test_the_unit_of_a_collada_file_counts(tmp_path, unit, size):
    (tmp_path / "cube.dae").write_text(collada(unit))
    (part,) = read_mesh(tmp_path / "cube.dae")
    assert np.allclose(np.ptp(part.vertices, axis=0), size)
    assert part.rgba == (1.0, 0.0, 0.0, 1.0)


def test_the_up_axis_of_a_collada_file_is_ignored_with_a_warning_or_applied(tmp_path):
    (tmp_path / "bar.dae").write_text(collada(1, "Y_UP"))
    conversion, _ = one_mesh(tmp_path, "bar.dae", scale="1 2 3")
    topic = "Y_UP of COLLADA files is ignored, as in RViz; if parts look turned, try --up-axis apply"
    assert notes(conversion, "warning") == [(topic, "bar.dae")]
    (part,) = read_mesh_of(tmp_path, conversion.files["assets/bar.stl"])
    assert part.vertices.max(axis=0).tolist() == [1.0, 2.0, 3.0]
    conversion, _ = one_mesh(tmp_path, "bar.dae", scale="1 2 3", up_axis="apply")
    assert notes(conversion, "warning") == []
    (part,) = read_mesh_of(tmp_path, conversion.files["assets/bar.stl"])
    assert part.vertices.min(axis=0).tolist() == [0.0, -2.0, 0.0], "the file's z axis points to -y"
    assert part.vertices.max(axis=0).tolist() == [1.0, 0.0, 3.0], "and its y axis upwards"
    (tmp_path / "bar.dae").write_text(collada(1, "Z_UP"))
    conversion, _ = one_mesh(tmp_path, "bar.dae", scale="1 2 3", up_axis="apply")
    (part,) = read_mesh_of(tmp_path, conversion.files["assets/bar.stl"])
    assert part.vertices.max(axis=0).tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<material id="m0">', '<material id="other">'),
        ('<instance_effect url="#e0"/>', '<instance_effect url="#nothing"/>'),
        (
            "<color>1 0 0 1</color></diffuse>",
            '<texture texture="sampler" texcoord="t"/></diffuse>',
        ),
    ],
    ids=["no material", "no effect", "no texture"],
)
def test_parts_of_a_collada_file_whose_material_is_incomplete_are_kept(tmp_path, old, new):
    text = collada(1, colours=((1, 0, 0, 1), (0, 0, 1, 1)))
    assert old in text
    text = text.replace(old, new)
    if "sampler" in new:
        sampler = '<newparam sid="sampler"><sampler2D><source>nothing</source></sampler2D></newparam>'
        text = text.replace('<effect id="e0"><profile_COMMON>', f'<effect id="e0"><profile_COMMON>{sampler}')
    (tmp_path / "cube.dae").write_text(text)
    parts = read_mesh(tmp_path / "cube.dae")
    assert sum(len(part.faces) for part in parts) == 12
    assert [part.rgba for part in parts if len(part.faces) == 6].count((0.0, 0.0, 1.0, 1.0)) == 1


def test_each_colour_of_a_collada_file_becomes_a_mesh(tmp_path):
    (tmp_path / "cube.dae").write_text(collada(1, colours=((1, 0, 0, 1), (0, 0, 1, 0.5))))
    _, model = one_mesh(tmp_path, "cube.dae")
    visuals = [i for i in range(model.ngeom) if model.geom_group[i] == 2]
    assert [model.mat_rgba[model.geom_matid[i]].round(2).tolist() for i in visuals] == [[1, 0, 0, 1], [0, 0, 1, 0.5]]


def test_a_mesh_without_colours_has_that_of_the_urdf(tmp_path):
    tetrahedron(tmp_path / "part.stl", 1)
    visual = f'{mesh("part.stl")}</geometry><material name="paint"/>'
    text = robot(
        '<material name="paint"><color rgba="0.1 0.2 0.3 1"/></material>',
        link("base", shape=BOX, visual=BOX),
        f'<link name="a"><visual><geometry>{visual}</visual></link>',
        joint("j", "base", "a"),
    )  # fmt: skip
    _, model = converted(tmp_path, text)
    geom = model.body("a").geomadr[0]
    assert model.material(model.geom_matid[geom]).name == "paint"
    assert model.mat_rgba[model.geom_matid[geom]] == pytest.approx([0.1, 0.2, 0.3, 1])


@pytest.mark.parametrize("folder", [".", "textures", "../textures"])
def test_a_texture_is_kept(tmp_path, folder):
    image = pytest.importorskip("PIL.Image")
    tmp_path = tmp_path / "meshes"
    (tmp_path / folder).resolve().mkdir(parents=True)
    tmp_path.mkdir(exist_ok=True)
    image.new("RGB", (8, 8), (0, 200, 0)).save(tmp_path / folder / "green.jpg")
    (tmp_path / "part.mtl").write_text(f"newmtl m\nmap_Kd {folder}/green.jpg\n")
    lines = [
        "mtllib part.mtl",
        *(f"v {x} {y} {z}" for x, y, z in CUBE),
        *(f"vt {x} {y}" for x, y, _ in CUBE),
        "usemtl m",
    ]
    lines += [f"f {a + 1}/{a + 1} {b + 1}/{b + 1} {c + 1}/{c + 1}" for a, b, c in FACES]
    (tmp_path / "part.obj").write_text("\n".join(lines))
    conversion, model = one_mesh(tmp_path, "part.obj")
    assert model.ntex == 3, "sky, floor and the part"
    assert {"assets/part.obj", "assets/part.png"} <= set(conversion.files)


def test_an_obj_without_materials_needs_no_library(tmp_path, monkeypatch):
    lines = [
        *(f"v {x} {y} {z}" for x, y, z in CUBE),
        "f 1 2 4 3",
        "f -4 -2 -1 -3",
        *(f"f {a + 1}//1 {b + 1} {c + 1}" for a, b, c in FACES[4:]),
    ]
    (tmp_path / "part.obj").write_text("\n".join(lines))
    monkeypatch.setitem(sys.modules, "trimesh", None)
    (part,) = read_mesh(tmp_path / "part.obj")
    assert (len(part.vertices), len(part.faces)) == (8, 12)


def test_ascii_stl_and_binary_stl_whose_header_begins_with_solid(tmp_path):
    lines = ["solid cube"]
    for face in FACES:
        lines += [
            "facet normal 0 0 0",
            "outer loop",
            *("vertex {} {} {}".format(*CUBE[i]) for i in face),
            "endloop",
            "endfacet",
        ]
    (tmp_path / "ascii.stl").write_text("\n".join([*lines, "endsolid cube"]))
    tetrahedron(tmp_path / "binary.stl", 2)
    content = (tmp_path / "binary.stl").read_bytes()
    (tmp_path / "binary.stl").write_bytes(b"solid x".ljust(80) + content[80:])
    (cube,), (corner,) = read_mesh(tmp_path / "ascii.stl"), read_mesh(tmp_path / "binary.stl")
    assert (len(cube.vertices), len(cube.faces)) == (8, 12)
    assert (len(corner.vertices), len(corner.faces)) == (4, 4)
    _, model = one_mesh(tmp_path, "ascii.stl")
    assert np.allclose(extents(model), 1.0, atol=1e-5)


def test_a_mirroring_scale_is_baked_in(tmp_path):
    tetrahedron(tmp_path / "part.stl", 1)
    conversion, model = one_mesh(tmp_path, "part.stl", scale="-1 2 3", visual=False)
    assert sorted(extents(model).round(5).tolist())[-1] > 2.9
    (part,) = read_mesh_of(tmp_path, conversion.files["assets/part_collision.stl"])
    corners = part.vertices[part.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(1.0), "its faces look outwards"
    assert part.vertices.min(axis=0).tolist() == [-1.0, 0.0, 0.0]


def read_mesh_of(tmp_path, content):
    (tmp_path / "out.stl").write_bytes(content)
    return read_mesh(tmp_path / "out.stl")


def flat(path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]], dtype="<f4")
    triangles = b"".join(bytes(12) + corners[list(face)].tobytes() + bytes(2) for face in ((0, 1, 2), (0, 2, 3)))
    path.write_bytes(bytes(80) + struct.pack("<I", 2) + triangles)


def test_flat_meshes_are_shown_and_collide_as_boxes(tmp_path):
    flat(tmp_path / "plate.stl")
    _, seen = one_mesh(tmp_path, "plate.stl")
    assert seen.nmesh == 1
    conversion, model = one_mesh(tmp_path, "plate.stl", visual=False)
    geom = model.geom("a_collision")
    assert sorted(geom.size.round(6).tolist()) == [0.0005, 0.5, 1.0]
    assert ("flat collision mesh became a box of 1 mm", "plate") in notes(conversion, "repair")


def test_large_meshes_are_simplified(tmp_path):
    n = 230
    grid = np.array(
        [[i / n, j / n, 0.1 * np.sin(9 * i / n) * np.cos(7 * j / n)] for i in range(n) for j in range(n)], dtype="<f4"
    )
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    assert len(faces) > 100_000
    records = np.zeros(len(faces), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    records["c"] = grid[faces]
    (tmp_path / "big.stl").write_bytes(bytes(80) + struct.pack("<I", len(faces)) + records.tobytes())
    conversion, model = one_mesh(tmp_path, "big.stl", max_faces=5000)
    assert 1000 < model.nmeshface <= 5100
    assert ("mesh simplified (--max-faces)", "big") in notes(conversion, "guess")


def test_files_of_one_name_and_uses_of_one_file(tmp_path):
    for folder, size in (("visual", 1), ("collision", 2)):
        tetrahedron(tmp_path / folder / "part.stl", size)
    text = robot(
        link("base", shape=mesh("collision/part.stl"), visual=mesh("visual/part.stl")),
        link("a", shape=mesh("collision/part.stl"), visual=mesh("collision/part.stl")),
        joint("j", "base", "a", xyz="0 0 3"),
    )
    conversion, model = converted(tmp_path, text)
    assert len([name for name in conversion.files if name.startswith("assets/")]) == 2, "each file is written once"
    assert model.nmesh == 3, "shapes that are shown and shapes that collide are different meshes"


def test_missing_meshes_are_reported_or_stop_a_strict_conversion(tmp_path):
    text = robot(
        link("base", shape=BOX),
        link("a", shape=mesh("no.stl"), visual=mesh("package://nobody/no.dae")),
        joint("j", "base", "a"),
    )
    conversion, _ = converted(tmp_path, text)
    assert notes(conversion, "error") == [("collision mesh left out, so the link passes through things", "a")]
    assert notes(conversion, "warning") == [("visual mesh left out", "a")]
    (tmp_path / "empty.obj").write_text("")
    twice = text.replace("</robot>", link("b", visual=mesh("empty.obj")) + link("c", visual=mesh("empty.obj")))
    twice += joint("k", "a", "b") + joint("l", "a", "c") + "</robot>"
    conversion, _ = converted(tmp_path, twice)
    assert [link for _, link in notes(conversion, "warning")] == ["a", "b", "c"], "each link of a broken mesh"
    with pytest.raises(ModelError, match=r"link 'a': 'package://nobody/no\.dae': there is no package 'nobody'"):
        converted(tmp_path, text, strict=True)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"nonsense", "is not an STL file"),
        ("a.stl", b"solid x\nvertex 1 2\nendsolid", "damaged STL"),
        ("a.obj", b"v 0 0 0\nf 1 2 3", "a face names a vertex that does not exist"),
        ("a.obj", b"v 0 0 x", "damaged OBJ"),
        ("a.obj", b"v 0 0 0", "contains no triangles"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3", "infinite or not a number"),
        ("a.dae", b"<COLLADA", "cannot be read"),
        ("a.step", b"", "the mesh format .step is not supported; known: .stl, .obj, .dae"),
    ],
)
def test_broken_meshes_are_named(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ModelError, match=re.escape(name)) as caught:
        read_mesh(tmp_path / name)
    assert message in str(caught.value)
    conversion, _ = one_mesh(tmp_path, name)
    assert notes(conversion, "warning") == [("visual mesh left out", "a")]


@pytest.mark.parametrize("missing", ["trimesh", "collada"])
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, missing):
    (tmp_path / "cube.dae").write_text(collada(1))
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ModelError) as caught:
        one_mesh(tmp_path, "cube.dae")
    assert str(caught.value).endswith(
        f"needs the Python library `{missing}`, which is not installed: pip install 'mjplug[convert]'"
    )


def test_stl_meshes_need_no_library(tmp_path, monkeypatch):
    for name in ("trimesh", "collada", "PIL", "PIL.Image", "xacro", "fast_simplification"):
        monkeypatch.setitem(sys.modules, name, None)
    tetrahedron(tmp_path / "part.stl", 1)
    _, model = one_mesh(tmp_path, "part.stl", max_faces=2)
    assert model.nmesh == 1


def test_meshes_are_found_by_the_name_in_package_xml(tmp_path):
    clone = tmp_path / "src" / "Some_Robots_Description"
    tetrahedron(clone / "meshes" / "part.stl", 1)
    (clone / "package.xml").write_text("<package><name>arm_description</name></package>")
    other = tmp_path / "src" / "bringup" / "urdf"
    other.mkdir(parents=True)
    (other.parent / "package.xml").write_text("<package><name>bringup</name></package>")
    for uri in (
        "package://arm_description/meshes/part.stl",
        "package:///arm_description/meshes/part.stl",
        "model://arm_description/meshes/part.stl",
    ):
        found = MeshFiles(other, Packages({}, other)).find(uri)
        assert found == clone / "meshes" / "part.stl"
    given = Packages({}, other, {"arm_description": tmp_path})
    with pytest.raises(ModelError, match=r"part\.stl: there is no such file in"):
        MeshFiles(other, given).find("package://arm_description/meshes/part.stl")


def test_absolute_paths_of_meshes_are_not_written(tmp_path):
    package = tmp_path / "arm_description"
    tetrahedron(package / "meshes" / "my part.stl", 1)
    (package / "package.xml").write_text("<package><name>arm_description</name></package>")
    tetrahedron(tmp_path / "elsewhere.stl", 1)
    text = robot(
        link(
            "base", visual=mesh(f"file://{package}/meshes/my%20part.stl"), shape=mesh(str(tmp_path / "elsewhere.stl"))
        ),
    )
    conversion, _ = converted(package, text)
    description = conversion.files["robot.urdf"].decode()
    assert 'filename="package://arm_description/meshes/my part.stl"' in description
    assert 'filename="elsewhere.stl"' in description
    assert str(tmp_path) not in description + conversion.files["conversion.json"].decode()


def test_a_link_to_divide_that_does_not_exist_is_an_error(tmp_path):
    angle(tmp_path / "angle.obj")
    with pytest.raises(ModelError, match="--decompose names the link 'bas', which the robot does not have, did you"):
        one_mesh(tmp_path, "angle.obj", visual=False, decompose="bas=0.1")


def test_a_concave_mesh_is_divided(tmp_path):
    pytest.importorskip("coacd")
    angle(tmp_path / "angle.obj")
    _, whole = one_mesh(tmp_path, "angle.obj", visual=False)
    conversion, parts = one_mesh(tmp_path, "angle.obj", visual=False, decompose="auto")
    assert whole.nmesh == 1
    assert parts.nmesh >= 2
    assert {topic for topic, _ in notes(conversion, "guess")} >= {"collision mesh divided into convex parts"}


def test_a_decomposition_that_takes_too_long_keeps_the_hull(tmp_path):
    pytest.importorskip("coacd")
    generator = np.random.default_rng(0)
    n = 40
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    circles = [np.stack([np.cos(angles), np.sin(angles), np.full(n, k / 4)], 1) for k in range(20)]
    rings = [circle * generator.uniform(0.2, 1, (n, 1)) for circle in circles]
    index = np.arange(20 * n).reshape(20, n)
    a, b = index[:-1], np.roll(index[:-1], -1, axis=1)
    c, d = np.roll(index[1:], -1, axis=1), index[1:]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    mesh, report = Mesh(np.concatenate(rings), faces), Report()
    assert Decomposer(None, report, time_limit=1).parts(mesh, "coil", threshold=0.01) == [mesh]
    assert [note.topic for note in report.notes] == ["decomposition takes over 1 s; the convex hull is used"]
