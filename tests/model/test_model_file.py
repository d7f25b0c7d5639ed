import struct
import threading
import zipfile

import mujoco
import numpy as np
import pytest
from model_files import tetrahedron, urdf

from mjplug.errors import ModelError
from mjplug.model.file import load_model
from mjplug.model.location import bundled_models

BALL = '<mujoco model="ball"><worldbody><body name="b"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.xml").write_text(BALL)
    return tmp_path


def refusal(*args, **kwargs):
    with pytest.raises(ModelError) as caught:
        load_model(*args, **kwargs)
    return str(caught.value)


def extents(model):
    """Returns the largest side of each mesh's bounding box, in any frame that MuJoCo chose."""
    vertices = [model.mesh_vert[a : a + n] for a, n in zip(model.mesh_vertadr, model.mesh_vertnum, strict=True)]
    return [float(max(np.linalg.norm(p - q) for p in points for q in points)) for points in vertices]


def test_an_xml_model_has_its_own_name(here):
    loaded = load_model("ball.xml")
    assert (loaded.name, loaded.path, loaded.model.nq) == ("ball", here / "ball.xml", 7)


def test_a_model_without_a_name_is_called_like_its_file(here):
    (here / "plain.xml").write_text("<mujoco/>")
    assert load_model("plain.xml").name == "plain"


def test_relative_names_count_from_the_folders_in_order_and_then_from_here(here):
    for name in ("one", "two"):
        (here / name).mkdir()
        (here / name / "m.xml").write_text(f'<mujoco model="{name}"/>')
    assert load_model("m.xml", here / "two", here / "one").name == "two"
    assert load_model("one/m.xml", here / "two").name == "one"
    assert load_model(str(here / "one" / "m.xml"), here / "two").name == "one"


def test_a_compiled_model_loads(here):
    mujoco.mj_saveModel(load_model("ball.xml").model, "ball.mjb")
    assert load_model("ball.mjb").name == "ball"


def test_the_error_for_a_compiled_model_of_another_version_names_the_version(here):
    mujoco.mj_saveModel(load_model("ball.xml").model, "ball.mjb")
    data = bytearray((here / "ball.mjb").read_bytes())
    struct.pack_into("=i", data, 12, 2_003_001)
    (here / "ball.mjb").write_bytes(data)
    assert refusal("ball.mjb") == (
        f"{here}/ball.mjb was compiled by MuJoCo 2.3.1, but MuJoCo {mujoco.__version__} is installed; "
        "use the model's XML, or compile it again"
    )


def test_what_is_no_compiled_model(here):
    (here / "a.mjb").write_bytes(b"hello, this is text")
    assert refusal("a.mjb") == f"{here}/a.mjb is not a compiled MuJoCo model"


@pytest.mark.parametrize("name", ["ball.xml", "packed.xml", "model.xml"])
def test_a_packed_model_loads(here, name):
    with zipfile.ZipFile("packed.mjz", "w") as archive:
        archive.write("ball.xml", name)
    assert load_model("packed.mjz").name == "ball"


def test_a_model_packed_by_mujoco_loads_with_its_mesh(here):
    tetrahedron(here / "t.stl", 1)
    (here / "t.xml").write_text(
        '<mujoco model="t"><asset><mesh file="t.stl"/></asset>'
        '<worldbody><geom type="mesh" mesh="t"/></worldbody></mujoco>'
    )
    spec = mujoco.MjSpec.from_file("t.xml")
    spec.assets = {"t.stl": (here / "t.stl").read_bytes()}
    with (here / "u.mjz").open("wb") as file:
        spec.to_zip(file)
    assert load_model("u.mjz").model.nmesh == 1


def test_the_error_for_a_missing_file_names_the_searched_paths(here):
    (here / "sub").mkdir()
    assert refusal("bal.xml", here / "sub") == (
        f"there is no model 'bal.xml' in {here}/sub or {here}, did you mean 'ball.xml'?"
    )
    assert refusal("/nowhere/ball.xml") == "there is no model 'ball.xml' in /nowhere"


def test_broken_mjcf_is_reported_in_the_words_of_mujoco(here):
    (here / "bad.xml").write_text("<mujoco>\n<worldbody>\n<bdy/>\n</worldbody>\n</mujoco>")
    assert refusal("bad.xml") == (
        f"{here}/bad.xml: XML Error: Schema violation: unrecognized element; Element 'bdy', line 3"
    )
    (here / "bad.xml").write_text("<mujoco>")
    assert refusal("bad.xml").startswith(f"{here}/bad.xml: XML parse error ")
    (here / "bad.xml").write_text('<mujoco><asset><mesh name="m" file="no.stl"/></asset></mujoco>')
    assert refusal("bad.xml") == f"{here}/bad.xml: Error: Error opening file 'no.stl'"


def test_what_is_no_model_file_is_refused_in_one_sentence(here):
    (here / "empty.xml").write_text("")
    (here / "folder").mkdir()
    (here / "arm.urdf.xacro").write_text("<robot/>")
    assert refusal("empty.xml") == f"{here}/empty.xml is empty"
    assert refusal("folder") == f"{here}/folder is a directory, not a model"
    assert refusal(".") == f"{here} is a directory, not a model; it contains arm.urdf.xacro, ball.xml, empty.xml"
    assert refusal("arm.urdf.xacro") == (
        f"MuJoCo does not read xacro files, so {here}/arm.urdf.xacro must be converted; do not set the option raw"
    )
    (here / "scene.sdf").write_text("<sdf/>")
    assert refusal("scene.sdf") == (
        f"{here}/scene.sdf is not a model file; the name of a model file ends with .xml, .mjcf, .urdf, .xacro, .mjb, "
        ".mjz"
    )
    (here / "bad.mjz").write_text("no archive")
    assert refusal("bad.mjz").startswith(f"{here}/bad.mjz: ")


def test_bundled_models_go_by_name():
    assert load_model("bundled:box").path.name == "box.xml"
    assert "box" in bundled_models()
    assert refusal("bundled:bax") == (
        f"unknown bundled model 'bax', did you mean 'box'?; known: {', '.join(bundled_models())}"
    )
    assert refusal("bundled:../config").startswith("unknown bundled model '../config'")


def test_a_model_in_a_ros_package(here):
    for folder in (here / "ws" / "share" / "scenes", here / "src" / "other"):
        (folder / "models").mkdir(parents=True)
        (folder / "models" / "m.xml").write_text(f'<mujoco model="{folder.name}"/>')
    environ = {"AMENT_PREFIX_PATH": f"/opt/ros/none:{here}/ws", "ROS_PACKAGE_PATH": str(here / "src")}
    assert load_model("package://scenes/models/m.xml", environ=environ).name == "scenes"
    assert load_model("package://other/models/m.xml", environ=environ).name == "other"
    assert refusal("package://scenes/models/n.xml", environ=environ) == (
        f"'package://scenes/models/n.xml': package 'scenes' in {here}/ws/share/scenes contains no file 'models/n.xml'"
    )
    assert refusal("package://nobody/m.xml", environ=environ) == (
        "'package://nobody/m.xml': there is no package 'nobody' in AMENT_PREFIX_PATH or ROS_PACKAGE_PATH"
    )


def test_the_meshes_of_a_urdf_are_found_in_its_package_without_ros(here):
    package = here / "arm_description"
    tetrahedron(package / "meshes" / "link.stl", 2)
    (package / "urdf").mkdir()
    (package / "urdf" / "arm.urdf").write_text(urdf("package://arm_description/meshes/link.stl"))
    loaded = load_model("arm_description/urdf/arm.urdf", environ={})
    assert loaded.name == "arm"
    assert [loaded.model.mesh(i).name for i in range(loaded.model.nmesh)] == ["link"]
    assert extents(loaded.model) == pytest.approx([2 * 2**0.5])


def test_the_meshes_of_a_urdf_are_found_in_another_package(here):
    tetrahedron(here / "ws" / "share" / "meshes_of_arm" / "link.stl", 3)
    (here / "arm.urdf").write_text(urdf("package://meshes_of_arm/link.stl"))
    model = load_model("arm.urdf", environ={"AMENT_PREFIX_PATH": str(here / "ws")}).model
    assert extents(model) == pytest.approx([3 * 2**0.5])


def test_the_mesh_of_a_urdf_may_lie_beside_it_when_there_is_no_package(here):
    tetrahedron(here / "link.stl", 1)
    (here / "arm.urdf").write_text(urdf("package://nobody/meshes/link.stl"))
    assert load_model("arm.urdf", environ={}).model.nmesh == 1
    (here / "arm.urdf").write_text(urdf(f"file://{here}/link.stl"))
    assert load_model("arm.urdf", environ={}).model.nmesh == 1
    tetrahedron(here / "assets" / "other.stl", 1)
    (here / "arm.urdf").write_text(urdf("other.stl", extension='<mujoco><compiler meshdir="assets"/></mujoco>'))
    assert load_model("arm.urdf", environ={}).model.nmesh == 1


def test_meshes_of_the_same_name_in_different_folders_stay_apart(here):
    tetrahedron(here / "arm" / "visual" / "link.stl", 1)
    tetrahedron(here / "arm" / "collision" / "link.stl", 2)
    keep = '<mujoco><compiler discardvisual="false"/></mujoco>'
    (here / "arm" / "arm.urdf").write_text(
        urdf("package://arm/collision/link.stl", "package://arm/visual/link.stl", keep)
    )
    model = load_model("arm/arm.urdf", environ={}).model
    assert model.nmesh == 2
    assert sorted(extents(model)) == pytest.approx([2**0.5, 2 * 2**0.5])
    assert sorted(model.geom_dataid) == [0, 1]


def test_visual_meshes_that_mujoco_drops_need_not_exist(here):
    tetrahedron(here / "link.stl", 1)
    (here / "arm.urdf").write_text(urdf("link.stl", "package://nobody/link.dae"))
    assert load_model("arm.urdf", environ={}).model.nmesh == 1


def test_meshes_that_cannot_be_used_are_named(here):
    (here / "arm.urdf").write_text(urdf("package://nobody/link.stl"))
    assert refusal("arm.urdf", environ={}) == (
        f"{here}/arm.urdf: 'package://nobody/link.stl': there is no package 'nobody' in AMENT_PREFIX_PATH or "
        "ROS_PACKAGE_PATH, nor in a folder around the URDF"
    )
    (here / "arm.urdf").write_text(urdf("link.dae"))
    assert (
        refusal("arm.urdf")
        == f"{here}/arm.urdf: MuJoCo does not support the mesh format of 'link.dae'; supported: .stl, .obj, .msh"
    )
    (here / "arm.urdf").write_text(urdf("meshes/link.stl"))
    assert refusal("arm.urdf") == f"{here}/arm.urdf: there is no mesh '{here}/meshes/link.stl'"


def test_a_urdf_without_meshes_and_a_broken_one(here):
    (here / "arm.urdf").write_text('<robot name="dot"><link name="base"/></robot>')
    assert load_model("arm.urdf").name == "dot"
    (here / "arm.urdf").write_text("<robot name='dot'>")
    assert refusal("arm.urdf").startswith(f"{here}/arm.urdf: XML parse error ")


def test_other_threads_run_while_a_model_compiles(here):
    meshes = "".join(f'<mesh name="m{i}" builtin="sphere" params="4"/>' for i in range(8))
    bodies = "".join(f'<body pos="{i} 0 0"><freejoint/><geom type="mesh" mesh="m{i % 8}"/></body>' for i in range(80))
    (here / "big.xml").write_text(f"<mujoco><asset>{meshes}</asset><worldbody>{bodies}</worldbody></mujoco>")
    done, turns = threading.Event(), 0

    def count():
        nonlocal turns
        while not done.wait(0.001):
            turns += 1

    counter = threading.Thread(target=count)
    counter.start()
    load_model("big.xml")
    done.set()
    counter.join(10)
    # With the GIL held, the thread would get a turn before and after the compilation, but hardly any in it.
    assert turns > 20
