"""`/tf` and `/tf_static`, against poses known by hand and against MuJoCo's own."""

import logging
import math

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from mjplug.contracts.transport import QoS
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.transforms import Transforms
from mjplug_schemas.tf2_msgs import TFMessage

ROBOT = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="table" pos="3 0 1" euler="0 0 1.5707963267948966"><geom size=".1"/></body>
    <body name="base" pos="0 0 1"><joint name="yaw" axis="0 0 1"/><geom size=".1"/>
      <body name="arm" pos="1 0 0"><joint name="pitch" axis="0 1 0"/><geom size=".1"/>
        <site name="imu" pos="0 0 .1" euler="3.141592653589793 0 0"/>
        <body name="bracket" pos="0 .5 0" euler="0 0 1.5707963267948966"><geom size=".1"/>
          <camera name="front" pos=".1 0 0" euler="1.5707963267948966 0 -1.5707963267948966"/>
          <body pos="0 0 .2"><geom size=".01"/>
            <body name="hand" pos="0 0 .3"><joint name="roll" axis="1 0 0"/><geom size=".1"/>
              <site name="sonar_site"/></body></body></body></body></body>
    <body name="ball" pos="0 0 5"><freejoint/><geom size=".1"/></body>
    <body name="target" mocap="true" pos="5 5 5"/>
    <camera name="follower" mode="targetbody" target="ball" pos="0 0 9"/>
    <site name="unsensed" pos="7 8 9"/>
  </worldbody>
  <sensor><gyro site="imu"/><rangefinder name="sonar" site="sonar_site"/><rangefinder name="scan-0" site="unsensed"/>
  </sensor>
</mujoco>
"""


def world_of(xml=ROBOT, rate=500.0, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.add(Transforms, "frames", rate=rate, **parameters)
    return world


def tree(message):
    """Returns parent, position and rotation matrix of each frame."""
    found = {}
    for entry in message.transforms:
        shift, turn = entry.transform.translation, entry.transform.rotation
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, np.array((turn.w, turn.x, turn.y, turn.z)))
        assert entry.child_frame_id not in found
        found[entry.child_frame_id] = (
            entry.header.frame_id, np.array((shift.x, shift.y, shift.z)), matrix.reshape(3, 3),
        )  # fmt: skip
    return found


def moving(world):
    return tree(world.published("/tf")[-1])


def fixed(world):
    (message,) = world.published("/tf_static")
    return tree(message)


def in_world(world, name):
    """Returns a frame's pose by going up to the root, as tf2 does."""
    links = fixed(world) | moving(world)
    position, rotation = np.zeros(3), np.eye(3)
    while name != "world":
        name, shift, turn = links[name]
        position, rotation = shift + turn @ position, turn @ rotation
    return position, rotation


def about(axis, angle):
    matrix, quat = np.empty(9), np.empty(4)
    mujoco.mju_axisAngle2Quat(quat, np.array(axis, float), angle)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def test_a_chain_of_three_bodies_turns_as_its_joints_do():
    world = world_of()
    yaw, pitch, roll = 0.7, -0.4, 1.1
    for name, angle in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
        world.data.joint(name).qpos[0] = angle
    world.loop.step(1)
    links = moving(world)
    for child, parent, position, rotation in (
        ("base", "world", (0.0, 0.0, 1.0), about((0, 0, 1), yaw)),
        ("arm", "base", (1.0, 0.0, 0.0), about((0, 1, 0), pitch)),
        ("hand", "bracket", (0.0, 0.0, 0.5), about((1, 0, 0), roll)),
    ):
        assert links[child][0] == parent
        assert links[child][1] == pytest.approx(np.array(position), abs=1e-12)
        assert links[child][2] == pytest.approx(rotation, abs=1e-12)
    # The whole chain by hand.
    position, rotation = in_world(world, "hand")
    turned = about((0, 0, 1), yaw) @ about((0, 1, 0), pitch)
    assert rotation == pytest.approx(turned @ about((0, 0, 1), math.pi / 2) @ about((1, 0, 0), roll), abs=1e-12)
    arm = np.array((0.0, 0.0, 1.0)) + about((0, 0, 1), yaw) @ (1.0, 0.0, 0.0)
    assert position == pytest.approx(arm + turned @ (0.0, 0.5, 0.5), abs=1e-12)


def test_every_frame_is_where_mujoco_has_it_at_the_time_of_the_stamp():
    world = world_of()
    model = mujoco.MjModel.from_xml_string(ROBOT)
    data = mujoco.MjData(model)
    for own in (world.data, data):
        own.qvel[:] = np.random.default_rng(0).normal(size=model.nv)
    for _ in range(100):
        world.loop.step(1)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert {entry.header.stamp.to_ns() for entry in world.published("/tf")[-1].transforms} == {200_000_000}
    for name in ("table", "base", "arm", "bracket", "hand", "ball", "target"):
        position, rotation = in_world(world, name)
        assert position == pytest.approx(data.body(name).xpos, abs=1e-12)
        assert rotation == pytest.approx(data.body(name).xmat.reshape(3, 3), abs=1e-12)
    position, rotation = in_world(world, "imu")
    assert position == pytest.approx(data.site("imu").xpos, abs=1e-12)
    assert rotation == pytest.approx(data.site("imu").xmat.reshape(3, 3), abs=1e-12)


def test_what_never_moves_in_its_parent_is_static_and_published_once():
    world = world_of()
    world.loop.step(10)
    assert {name: link[0] for name, link in fixed(world).items()} == {
        "table": "world", "bracket": "arm", "front_frame": "bracket", "imu": "arm", "sonar_frame": "hand",
    }  # fmt: skip
    assert {name: link[0] for name, link in moving(world).items()} == {
        "base": "world", "arm": "base", "hand": "bracket", "ball": "world", "target": "world",
        "follower_frame": "world",
    }  # fmt: skip
    assert world.transport.qos["/tf_static"] == QoS(1, "reliable", "transient_local")
    assert world.transport.qos["/tf"].durability == "volatile"


def optical_axes(camera_xmat):
    """Returns right, down and forward of a MuJoCo camera as columns."""
    right, up, back = camera_xmat.reshape(3, 3).T
    return np.column_stack((right, -up, -back))


@pytest.mark.parametrize("name", ["front", "follower"])
def test_a_camera_has_its_optical_frame(name):
    world = world_of()
    world.data.joint("yaw").qvel[0] = 5.0
    world.data.qvel[world.model.body("ball").dofadr[0] :][:3] = (3.0, 2.0, 1.0)
    world.loop.step(200)
    position, rotation = in_world(world, f"{name}_frame")
    mujoco.mj_forward(world.model, world.data)
    assert position == pytest.approx(world.data.camera(name).xpos, abs=1e-9)
    assert rotation == pytest.approx(optical_axes(world.data.camera(name).xmat), abs=1e-9)
    if name == "follower":
        to_ball = world.data.body("ball").xpos - position
        assert rotation[:, 2] == pytest.approx(to_ball / np.linalg.norm(to_ball))


def test_a_rangefinder_has_a_frame_that_looks_along_x():
    world = world_of()
    world.loop.step(1)
    position, rotation = in_world(world, "sonar_frame")
    site = world.data.site("sonar_site")
    assert position == pytest.approx(site.xpos)
    assert rotation[:, 0] == pytest.approx(site.xmat.reshape(3, 3)[:, 2])


def test_sites_and_cameras_are_chosen():
    assert set(fixed(world_of(cameras=False, sites="none"))) == {"table", "bracket"}
    assert set(fixed(world_of(cameras=False, sites="all"))) == {
        "table", "bracket", "imu", "sonar_site", "sonar_frame", "unsensed",
    }  # fmt: skip
    assert set(fixed(world_of(cameras=False, sites=["unsensed"]))) == {"table", "bracket", "unsensed"}


def test_chosen_bodies_have_the_nearest_selected_ancestor_as_parent():
    world = world_of(bodies=["hand", "arm"], cameras=False, sites=["sonar_site"])
    world.data.joint("yaw").qvel[0] = 2.0
    world.data.joint("roll").qvel[0] = 1.0
    world.loop.step(100)
    assert {name: link[0] for name, link in moving(world).items()} == {"arm": "world", "hand": "arm"}
    assert {name: link[0] for name, link in fixed(world).items()} == {"sonar_site": "hand"}
    mujoco.mj_kinematics(world.model, world.data)
    assert in_world(world, "hand")[0] == pytest.approx(world.data.body("hand").xpos, abs=1e-9)
    # Without the body that it is on, a site moves.
    without = world_of(exclude=["hand", "bracket", "arm"], cameras=False)
    without.data.joint("pitch").qpos[0] = 0.5
    without.loop.step(1)
    assert moving(without)["imu"][0] == "base"
    mujoco.mj_kinematics(without.model, without.data)
    assert in_world(without, "imu")[1] == pytest.approx(without.data.site("imu").xmat.reshape(3, 3), abs=1e-9)


def test_a_root_has_no_parent_here_and_the_rest_hangs_on_it():
    world = world_of(roots=["base"], world_frame="map")
    world.loop.step(1)
    assert "base" not in moving(world)
    assert moving(world)["arm"][0] == "base"
    assert moving(world)["ball"][0] == "map"


def test_more_frames_can_be_fixed_to_bodies_sites_and_cameras():
    world = world_of(
        frames={
            "camera_color_optical_frame": {"camera": "front"},
            "gripper": {"body": "hand", "xyz": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]},
            "lidar": {"site": "unsensed", "rpy": [0.0, 0.0, math.pi / 2]},
            "origin": {"body": "world", "xyz": [1.0, 0.0, 0.0]},
        }
    )
    world.loop.step(1)
    links = fixed(world)
    assert np.array_equal(links["camera_color_optical_frame"][1], links["front_frame"][1])
    assert links["camera_color_optical_frame"][2] == pytest.approx(links["front_frame"][2])
    parent, position, rotation = links["gripper"]
    assert parent == "hand"
    assert list(position) == pytest.approx([0.1, 0.2, 0.3])
    # Roll, pitch and yaw about fixed axes, as in a URDF.
    assert rotation == pytest.approx(about((0, 0, 1), 0.3) @ about((0, 1, 0), 0.2) @ about((1, 0, 0), 0.1))
    assert links["lidar"][2] == pytest.approx(about((0, 0, 1), math.pi / 2), abs=1e-12)
    assert (links["origin"][0], list(links["origin"][1])) == ("world", [1.0, 0.0, 0.0])


def test_a_frame_can_be_fixed_to_a_camera_that_moves_by_itself():
    world = world_of(frames={"lens": {"camera": "follower", "xyz": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]}})
    world.data.qvel[world.model.body("ball").dofadr[0] :][:3] = (3.0, 2.0, 1.0)
    world.loop.step(100)
    mujoco.mj_forward(world.model, world.data)
    axes = optical_axes(world.data.camera("follower").xmat)
    parent, position, rotation = moving(world)["lens"]
    assert parent == "world"
    assert position == pytest.approx(world.data.camera("follower").xpos + axes @ (0.1, 0.2, 0.3), abs=1e-9)
    turn = about((0, 0, 1), 0.3) @ about((0, 1, 0), 0.2) @ about((1, 0, 0), 0.1)
    assert rotation == pytest.approx(axes @ turn, abs=1e-9)


def test_stamps_continue_at_a_reset_and_poses_come_back():
    world = world_of()
    world.data.joint("yaw").qvel[0] = 2.0
    world.loop.step(100)
    world.loop.reset(Reset())
    world.loop.step(1)
    stamps = [message.transforms[0].header.stamp.to_ns() for message in world.published("/tf")]
    assert stamps == [2_000_000 * k for k in range(1, 102)]
    assert moving(world)["base"][2] == pytest.approx(np.eye(3), abs=1e-6)


def test_nothing_is_computed_without_subscribers():
    world = world_of()
    world.transport.publishers["/tf"].matched = False
    world.loop.step(10)
    assert not world.published("/tf")
    assert world.loop.scheduler.next_due > world.simulation.step + 1000


def test_a_site_that_has_the_name_of_a_body_is_that_body_if_it_is_there_and_is_named_otherwise(caplog):
    def with_site(pos):
        return f"""<mujoco><worldbody><body name="imu"><freejoint/><geom size=".1"/>
          <site name="imu" pos="{pos}"/></body></worldbody><sensor><gyro site="imu"/></sensor></mujoco>"""

    with caplog.at_level(logging.WARNING):
        assert not world_of(with_site("0 0 0")).published("/tf_static")
    assert not caplog.records
    with caplog.at_level(logging.WARNING):
        world_of(with_site("0 0 1"))
    assert "two frames would be called 'imu'" in caplog.text


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"bodies": ["hnad"]}, "unknown body 'hnad', did you mean 'hand'"),
        ({"roots": ["x"]}, "unknown body 'x'"),
        ({"sites": ["imuu"]}, "unknown site 'imuu', did you mean 'imu'"),
        ({"frames": {"f": {"camera": "fromt"}}}, "unknown camera 'fromt', did you mean 'front'"),
        ({"frames": {"arm": {"body": "hand"}}}, "frames: another frame is already called 'arm'; choose another name"),
        ({"world_frame": "base"}, "body 'base' has the same name as the world frame"),
    ],
)
def test_what_does_not_fit_the_model_stops_the_start(parameters, sentence):
    with pytest.raises(MjplugError, match=sentence):
        world_of(**parameters)


@pytest.mark.parametrize(
    "wrong", [{"rate": 0.0}, {"frames": {"f": {}}}, {"frames": {"f": {"body": "a", "site": "b"}}}, {"sites": "some"}]
)
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ValidationError):
        Transforms.parameters_type(**wrong)


@pytest.mark.parametrize("name", ["quadruped", "mobile_base", "box", "arm"])
def test_the_models_that_come_along_make_one_tree(name):
    world = World(load_model(f"bundled:{name}").model)
    world.add(Transforms, "frames")
    world.loop.step(100)
    parents = {child: link[0] for child, link in (fixed(world) | moving(world)).items()}
    for child in parents:
        assert in_world(world, child)[0].shape == (3,)
    assert all(parent == "world" or parent in parents for parent in parents.values())


def test_a_model_with_nothing_in_it_has_no_frames(caplog):
    with caplog.at_level(logging.WARNING):
        world = world_of("<mujoco/>")
    assert "no frames are published" in caplog.text
    assert world.transport.types == {"/tf": TFMessage, "/tf_static": TFMessage}
    assert not world.published("/tf_static")
