"""What becomes of the links and meshes of a URDF."""

import pytest
from model_files import tetrahedron, urdf

from mjplug.errors import ModelError
from mjplug.model.file import load_model
from mjplug.testing import World
from mjplug_plugins.transforms import Transforms

MASS = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def joint(kind, parent, child):
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        '<origin xyz="0 0 1"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )


def robot(extension="", root="base_link"):
    mass = "" if root == "world" else MASS
    return (
        f'<robot name="arm">{extension}<link name="{root}">{mass}</link><link name="column"/>'
        f'<link name="arm">{MASS}</link><link name="tool0"/>{joint("fixed", root, "column")}'
        f"{joint('revolute', 'column', 'arm')}{joint('fixed', 'arm', 'tool0')}</robot>"
    )


def links(model):
    return [model.body(body).name for body in range(1, model.nbody)]


def load(folder, text):
    (folder / "arm.urdf").write_text(text)
    return load_model(str(folder / "arm.urdf"), environ={}).model


@pytest.mark.parametrize("extension", ["", "<mujoco/>", '<mujoco><compiler discardvisual="true"/></mujoco>'])
def test_root_and_links_behind_fixed_joints_stay(tmp_path, extension):
    model = load(tmp_path, robot(extension))
    assert links(model) == ["base_link", "column", "arm", "tool0"]
    assert (model.nq, model.body_subtreemass[0]) == (1, 4.0)
    assert model.body("tool0").pos.tolist() == [0, 0, 1]


def test_a_urdf_may_merge_its_fixed_links_itself(tmp_path):
    assert links(load(tmp_path, robot('<mujoco><compiler fusestatic="true"/></mujoco>'))) == ["arm"]


def test_a_root_that_is_called_world_is_the_world(tmp_path):
    assert links(load(tmp_path, robot(root="world"))) == ["column", "arm", "tool0"]


def test_all_links_of_a_urdf_are_in_tf(tmp_path):
    world = World(load(tmp_path, robot()))
    world.add(Transforms, "transforms")
    world.loop.step(100)
    parents = {
        transform.child_frame_id: transform.header.frame_id
        for topic in ("/tf", "/tf_static")
        for transform in world.published(topic)[-1].transforms
    }
    assert parents == {"base_link": "world", "column": "base_link", "arm": "column", "tool0": "arm"}


@pytest.mark.parametrize(
    ("options", "filename", "file"),
    [
        ('meshdir="meshes"', "link.stl", "meshes/link.stl"),
        ('meshdir="meshes"', "meshes/link.stl", "meshes/link.stl"),
        ('meshdir="meshes"', "sub/link.stl", "meshes/link.stl"),
        ('meshdir="meshes"', "sub/link.stl", "meshes/sub/link.stl"),
        ('meshdir="meshes" strippath="false"', "meshes/link.stl", "meshes/link.stl"),
        ('meshdir="meshes" strippath="true"', "meshes/link.stl", "meshes/link.stl"),
        ('assetdir="meshes"', "meshes/link.stl", "meshes/link.stl"),
        ("", "meshes/link.stl", "meshes/link.stl"),
        ("", "meshes/link.stl", "link.stl"),
    ],
)
def test_a_mesh_may_count_from_meshdir_or_from_the_urdf(tmp_path, options, filename, file):
    tetrahedron(tmp_path / file, 1)
    assert load(tmp_path, urdf(filename, extension=f"<mujoco><compiler {options}/></mujoco>")).nmesh == 1


def test_a_mesh_in_meshdir_goes_before_one_that_counts_from_the_urdf(tmp_path):
    tetrahedron(tmp_path / "meshes" / "meshes" / "link.stl", 1)
    tetrahedron(tmp_path / "meshes" / "link.stl", 3)
    model = load(tmp_path, urdf("meshes/link.stl", extension='<mujoco><compiler meshdir="meshes"/></mujoco>'))
    assert float(abs(model.mesh_vert).max()) < 2, "the small one"


def test_a_mesh_that_is_nowhere_is_named_with_both_places(tmp_path):
    text = urdf("a/link.stl", extension='<mujoco><compiler meshdir="meshes"/></mujoco>')
    with pytest.raises(ModelError) as caught:
        load(tmp_path, text)
    file = tmp_path / "arm.urdf"
    assert str(caught.value) == (
        f"{file}: there is no mesh '{tmp_path}/meshes/a/link.stl', nor '{tmp_path}/a/link.stl'"
    )


CONTROL = (
    '<ros2_control name="sim" type="system"><hardware/><joint name="arm_joint"><command_interface name="position"/>'
    '<state_interface name="position"/></joint><joint name="tool0_joint"><state_interface name="position"/></joint>'
    "</ros2_control>"
)


def test_control_that_mujoco_does_not_read_is_warned_about(tmp_path, caplog):
    assert load(tmp_path, robot(CONTROL)).nu == 0
    assert caplog.messages == [
        "arm.urdf: MuJoCo does not read <ros2_control>, so the model has no actuators and these joints cannot be "
        "commanded: arm_joint; add <actuator> elements to an MJCF of this model"
    ]


def test_a_urdf_without_control_is_not_warned_about(tmp_path, caplog):
    load(tmp_path, robot())
    assert caplog.messages == []
