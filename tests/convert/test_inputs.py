"""`<mujoco_inputs>`: cameras, lidars, changed elements, copied sections and scenes; mistakes are errors."""

import mujoco
import numpy as np
import pytest
import yaml
from model_files import tetrahedron

from convert.robots import ARM, angle, at_home, converted
from mjplug.errors import ModelError


def inputs(raw="", processed="", scene=""):
    parts = {"raw_inputs": raw, "processed_inputs": processed, "scene": scene}
    sections = "".join(f"<{tag}>{text}</{tag}>" for tag, text in parts.items() if text)
    return f"<mujoco_inputs>{sections}</mujoco_inputs>"


def arm_with(text, arm=ARM):
    return arm.replace("</robot>", f"{text}</robot>")


def test_links_have_sites_only_if_they_are_needed(tmp_path):
    _, without = converted(tmp_path, ARM)
    _, asked = converted(tmp_path, ARM, sites=True)
    _, given = converted(tmp_path, arm_with(inputs(raw="<size/>")))
    assert without.nsite == 0
    assert [site.nsite for site in (asked, given)] == [4, 4]


def test_a_camera_looks_along_the_z_axis_of_its_optical_frame(tmp_path):
    camera = '<camera site="tool0" name="eye" fovy="58" mode="fixed" resolution="64 48"/>'
    conversion, model = converted(tmp_path, arm_with(inputs(processed=camera)))
    data = at_home(model)
    mujoco.mj_forward(model, data)
    eye, tool = data.camera("eye").xmat.reshape(3, 3), data.body("tool0").xmat.reshape(3, 3)
    assert np.allclose(-eye[:, 2], tool[:, 2])
    assert np.allclose(-eye[:, 1], tool[:, 1])
    assert model.camera("eye").fovy[0] == 58
    assert model.cam_resolution[model.camera("eye").id].tolist() == [64, 48]
    assert "camera" in yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]


def test_two_cameras_at_one_site_are_both_there(tmp_path):
    cameras = '<camera site="tool0" name="a"/><camera site="tool0" name="b"/>'
    _, model = converted(tmp_path, arm_with(inputs(processed=cameras)))
    assert [model.camera(i).name for i in range(model.ncam)] == ["a", "b"]


def test_a_lidar_has_rays_from_its_x_axis_towards_y(tmp_path):
    lidar = '<lidar ref_site="base" sensor_name="rf" min_angle="-0.3" max_angle="0.3" angle_increment="0.025"/>'
    sensor = '<sensor><rangefinder name="scan" site="rf"/></sensor>'
    conversion, model = converted(tmp_path, arm_with(inputs(sensor, lidar)))
    assert model.nsensor == 25
    data = at_home(model)
    mujoco.mj_forward(model, data)
    for i in (0, 12, 24):
        axis = data.site(f"rf-{i:02d}").xmat.reshape(3, 3)[:, 2]
        angle = -0.3 + 0.025 * i
        assert np.allclose(axis, [np.cos(angle), np.sin(angle), 0], atol=1e-9)
    plugin = yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]["rangefinder_lidar"]
    assert plugin["scan"] == {"frame_name": "base", "min_angle": -0.3, "max_angle": 0.3, "angle_increment": 0.025}


def test_elements_are_changed_by_name_and_geoms_by_mesh_and_class(tmp_path):
    tetrahedron(tmp_path / "part.stl", 0.1)
    arm = ARM.replace('<box size="0.05 0.05 0.2"/>', '<mesh filename="part.stl"/>')
    changes = (
        '<modify_element type="joint" name="elbow" damping="7" frictionloss="0.5"/>'
        '<modify_element type="body" name="upper" gravcomp="0"/>'
        '<modify_element type="geom" mesh="part" class="collision" friction="0.3 0.01 0.001"/>'
    )
    _, model = converted(tmp_path, arm_with(inputs(processed=changes), arm))
    assert (model.joint("elbow").damping[0], model.joint("elbow").frictionloss[0]) == (7.0, 0.5)
    assert model.body_gravcomp[model.body("upper").id] == 0.0
    assert model.geom("lower_collision").friction.tolist() == [0.3, 0.01, 0.001]


def test_copied_actuators_defaults_and_options_replace_generated_ones(tmp_path):
    raw = (
        '<option timestep="0.001"/><compiler autolimits="true"/><default><default class="visual"><geom group="1"/>'
        '</default><default class="own"><geom rgba="1 0 0 1"/></default></default>'
        '<actuator><motor name="drive" joint="elbow" gear="3"/></actuator>'
        '<sensor><jointpos name="angle" joint="elbow"/></sensor>'
    )
    conversion, model = converted(tmp_path, arm_with(inputs(raw)))
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "drive"]
    assert not model.jnt_actfrclimited[model.joint("elbow").id]
    assert (model.opt.timestep, model.opt.integrator) == (0.001, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    assert {model.geom_group[i] for i in range(model.ngeom) if not model.geom_contype[i]} == {1}
    assert "sensors" in yaml.safe_load(conversion.files["mjplug.yaml"])["plugins"]


def test_a_copied_keyframe_called_home_is_kept(tmp_path):
    _, model = converted(tmp_path, arm_with(inputs('<keyframe><key name="home" qpos="0.1 0.2"/></keyframe>')))
    assert (model.nkey, model.key("home").qpos.tolist()) == (1, [0.1, 0.2])


def test_a_scene_of_the_inputs_replaces_the_default_unless_another_is_chosen(tmp_path):
    scene = '<worldbody><geom name="ramp" type="plane" size="1 1 1"/></worldbody>'
    _, own = converted(tmp_path, arm_with(inputs(scene=scene)))
    _, chosen = converted(tmp_path, arm_with(inputs(scene=scene)), scene="floor")
    assert {"ramp", "floor"} & {own.geom(i).name for i in range(own.ngeom)} == {"ramp"}
    assert {"ramp", "floor"} & {chosen.geom(i).name for i in range(chosen.ngeom)} == {"floor"}


def test_several_inputs_and_files_are_merged(tmp_path):
    (tmp_path / "a.xml").write_text(inputs(processed='<camera site="base" name="a"/>'))
    second = inputs(processed='<camera site="upper" name="b"/>')
    (tmp_path / "b.urdf").write_text(f"<robot>{second}</robot>")
    own = arm_with(inputs(processed='<camera site="tool0" name="c"/>'))
    _, model = converted(tmp_path, own, mujoco_inputs=(str(tmp_path / "a.xml"), str(tmp_path / "b.urdf")))
    assert {model.camera(i).name for i in range(model.ncam)} == {"a", "b", "c"}


def test_a_mesh_is_decomposed_by_name(tmp_path):
    pytest.importorskip("coacd")
    angle(tmp_path / "part.obj")
    arm = ARM.replace('<box size="0.05 0.05 0.2"/>', '<mesh filename="part.obj" scale="0.1 0.1 0.1"/>')
    conversion, model = converted(tmp_path, arm_with(inputs(processed='<decompose_mesh mesh_name="part"/>'), arm))
    assert "part" in [note.subject for note in conversion.report.of("guess")]
    assert model.body("lower").geomnum[0] >= 2


CAMERA = '<camera site="tool0" name="a"/>'
LIDAR = '<lidar ref_site="base" sensor_name="r" min_angle="0" max_angle="1" angle_increment="{}"/>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            inputs(processed=CAMERA.replace("tool0", "tool")),
            "camera 'a' is at site 'tool', but the robot has no such link",
        ),
        (inputs(processed=CAMERA * 2), "two cameras have the name 'a'"),
        (inputs(processed='<camera site="tool0"/>'), "a <camera> has no attribute 'name'"),
        (inputs(processed=LIDAR.format(0)), "the increment must be above zero"),
        (inputs(processed=LIDAR.format("x")), "angle_increment of lidar 'r' is 'x'"),
        (inputs(processed=LIDAR.format(0.1) * 2), "two lidars have the sensor_name 'r'"),
        (inputs(processed=LIDAR.format(0.1).replace("base", "bas")), "lidar 'r' is at site 'bas'"),
        (inputs(processed='<modify_element name="elbow"/>'), "a <modify_element> has no attribute 'type'"),
        (inputs(processed='<modify_element type="joint"/>'), "a <modify_element> of type 'joint' has no name"),
        (
            inputs(processed='<modify_element type="joint" name="elbo" damping="1"/>'),
            "the model has no joint with the name 'elbo', did you mean 'elbow'?",
        ),
        (
            inputs(processed='<modify_element type="geom" mesh="part" friction="1"/>'),
            "a <modify_element> of type 'geom' needs 'name', or 'mesh' and 'class'",
        ),
        (inputs(processed='<modify_element type="geom" mesh="part" class="visual"/>'), "no geom with the mesh 'part'"),
        (
            inputs(processed='<decompose_mesh mesh_name="part"/>'),
            "<decompose_mesh> names the mesh 'part', which no link",
        ),
        (
            inputs(processed='<decompose_mesh mesh_name="part" threshold="-1"/>'),
            "the threshold of mesh 'part' is -1; it must be from 0.01 to 1",
        ),
        (inputs(processed=LIDAR.format("1e-5")), "lidar 'r' has 100001 rangefinders, at most 4096 are allowed"),
        (inputs(processed='<decompose_mesh threshold="1"/>'), "a <decompose_mesh> has no attribute 'mesh_name'"),
        (inputs(processed="<cameras/>"), "unknown element <cameras> in processed_inputs, did you mean 'camera'?"),
        ("<mujoco_inputs><raw/></mujoco_inputs>", "unknown section <raw>; known: raw_inputs, processed_inputs, scene"),
        ("<mujoco_inputs><raw_inputs/><raw_inputs/></mujoco_inputs>", "contains <raw_inputs> twice"),
        (inputs('<actuator><motor joint="no"/></actuator>'), "MuJoCo does not accept the converted model"),
    ],
)
def test_mistakes_are_errors(tmp_path, text, message):
    with pytest.raises(ModelError, match=r"robot\.urdf") as caught:
        converted(tmp_path, arm_with(text))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<mujoco/>", "the root element is <mujoco>; it must be <mujoco_inputs> or <robot>"),
        ("<robot/>", "contains no <mujoco_inputs>"),
        ("<robot", "is not valid XML"),
        (None, "cannot be read: No such file"),
    ],
)
def test_wrong_files_are_named(tmp_path, content, message):
    if content is not None:
        (tmp_path / "inputs.xml").write_text(content)
    with pytest.raises(ModelError, match=r"inputs\.xml") as caught:
        converted(tmp_path, ARM, mujoco_inputs=(str(tmp_path / "inputs.xml"),))
    assert message in str(caught.value)
