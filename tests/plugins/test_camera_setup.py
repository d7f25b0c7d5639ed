"""What can be configured, what is refused, and how a way to OpenGL is found."""

import logging
import textwrap
import warnings
from functools import partial
from types import SimpleNamespace

import mujoco
import pytest
from camera_scenes import (
    closing,  # noqa: F401 - a fixture
    gl,  # noqa: F401 - a fixture
    refusal,
    scene,
    world_of,
)

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import PluginError
from mjplug.model.file import load_model
from mjplug.plugin import Host, UnavailableError
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.camera import Camera
from mjplug_plugins.camera.gl import BACKEND_VARIABLE, GlContext, environments
from mjplug_plugins.camera.parameters import CameraParameters
from mjplug_plugins.camera.view import camera_names
from mjplug_schemas.names import resolve, validate_name
from mjplug_schemas.sensor_msgs import CameraInfo, CompressedImage, Image

TWO = '<camera name="front" resolution="16 12"/><camera name="wrist" resolution="20 30"/>'

DEMO = """\
/**:
  ros__parameters:
    mujoco_plugins:
      mujoco_camera_plugin:
        type: "mujoco_ros2_control_plugins/CameraPlugin"
        camera_publish_rate: 6.0
        camera:
          frame_name: camera_color_optical_frame
          info_topic: /camera/color/camera_info
          image_topic: /camera/color/image_raw
          depth_topic: /camera/aligned_depth_to_color/image_raw
"""


def selected_of(tmp_path, text):
    (tmp_path / "plugins.yaml").write_text(textwrap.dedent(text))
    _, (selected,) = select(read(tmp_path / "plugins.yaml", model="bundled:arm"))
    return selected


def test_the_demo_s_configuration_and_model_load_unchanged(tmp_path):
    selected = selected_of(tmp_path, DEMO)
    assert selected.plugin_class is Camera
    model = load_model("bundled:arm").model
    assert [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_CAMERA, i) for i in range(model.ncam)].count("camera") == 1
    others = {name: {"policy": "disabled"} for name in camera_names(model) if name != "camera"}
    world = World(model)
    try:
        world.add(Camera, "mujoco_camera_plugin", **selected.parameters.model_dump(exclude_unset=True) | others)
        world.loop.step(100)
        (image,) = world.published("/camera/color/image_raw")
        assert image.header.frame_id == "camera_color_optical_frame"
        # A sixth of a second, at the first step after it.
        assert image.header.stamp.to_ns() == 168_000_000
        assert (image.width, image.height) == (640, 480)
        assert len(world.published("/camera/aligned_depth_to_color/image_raw")) == 1
        # By the reference: f = 240 / tan(29°).
        assert world.published("/camera/color/camera_info")[0].k[0] == pytest.approx(432.9715, abs=1e-4)
    finally:
        world.workers.close()


def test_names_and_defaults_are_those_of_the_reference():
    world = world_of(scene(TWO), wrist={"policy": "polled"})
    types = {name.removeprefix("/cameras/"): kind for name, kind in world.transport.types.items()}
    for name in ("front", "wrist"):
        assert types[f"{name}/color"] is types[f"{name}/depth"] is Image
        assert types[f"{name}/camera_info"] is CameraInfo
        assert types[f"{name}/color/compressed"] is types[f"{name}/depth/compressedDepth"] is CompressedImage
    assert {world.transport.qos[f"/cameras/front/{t}"].depth for t in ("color", "depth", "camera_info")} == {1}
    assert world.transport.services == {"/cameras/wrist/trigger"}
    world.loop.step(100)
    assert world.published("/cameras/front/color")[0].header.frame_id == "front_frame"
    assert CameraParameters().camera_publish_rate == 5.0


def test_the_trigger_s_name_can_be_set():
    world = world_of(scene(TWO), front={"policy": "polled", "trigger_service_name": "/take_picture"})
    assert world.transport.services == {"/take_picture"}


def test_an_unnamed_camera_gets_a_name_of_its_number():
    cameras = '<camera resolution="16 12"/><camera name="wrist" resolution="16 12"/><camera resolution="16 12"/>'
    world = world_of(scene(cameras), camera_2={"frame_name": "second"})
    world.loop.step(100)
    assert world.published("/cameras/camera_0/color")[0].header.frame_id == "camera_0_frame"
    assert world.published("/cameras/camera_2/color")[0].header.frame_id == "second"
    assert len(world.published("/cameras/wrist/color")) == 1


def test_an_unnamed_camera_leaves_its_number_s_name_to_a_camera_that_has_it():
    cameras = '<camera resolution="16 12"/><camera name="camera_0" resolution="20 12"/>'
    world = world_of(scene(cameras))
    world.loop.step(100)
    assert world.published("/cameras/camera_0/color")[0].width == 20
    (image,) = world.published("/cameras/camera_0_2/color")
    assert (image.width, image.header.frame_id) == (16, "camera_0_2_frame")


def test_an_unknown_camera_is_refused_with_the_known_ones():
    assert refusal(scene(TWO), frnt={"policy": "disabled"}) == (
        "unknown camera 'frnt', did you mean 'front'?; known: front, wrist"
    )
    assert refusal(scene(""), front={}) == "unknown camera 'front'; there is no camera"


UNSIZED = '<camera name="a"/><camera name="b" resolution="16 12"/><camera name="c"/>'


def sizes(xml, **parameters):
    world = world_of(xml, **parameters)
    world.loop.step(100)
    names = [camera for camera in "abc" if f"/cameras/{camera}/color" in world.transport.publishers]
    images = {camera: world.published(f"/cameras/{camera}/color")[0] for camera in names}
    for camera, image in images.items():
        info = world.published(f"/cameras/{camera}/camera_info")[0]
        assert (info.width, info.height) == (image.width, image.height)
        assert len(image.data) == 3 * image.width * image.height
    return {camera: (image.width, image.height) for camera, image in images.items()}


def test_a_camera_without_a_resolution_has_the_size_of_the_model_s_offscreen_buffer(caplog):
    caplog.set_level(logging.INFO)
    assert sizes(scene(UNSIZED)) == {"a": (640, 480), "b": (16, 12), "c": (640, 480)}
    assert "the size of the model's offscreen buffer: a 640x480, c 640x480" in caplog.text
    small = scene(UNSIZED, visual='<global offwidth="60" offheight="40"/>')
    assert sizes(small) == {"a": (60, 40), "b": (16, 12), "c": (60, 40)}


def test_the_plugin_s_size_is_that_of_every_camera_without_a_size_of_its_own_in_the_configuration(caplog):
    caplog.set_level(logging.INFO)
    small = scene(UNSIZED, visual='<global offwidth="60" offheight="40"/>')
    expected = {"a": (32, 24), "b": (32, 24), "c": (20, 10)}
    assert sizes(small, width=32, height=24, c={"width": 20, "height": 10}) == expected
    assert "offscreen" not in caplog.text
    expected = {"a": (32, 40), "b": (32, 12)}
    assert sizes(small, width=32, c={"policy": "disabled"}) == expected
    assert sizes(small, a={"width": 20})["a"] == (20, 40)


def test_a_model_without_cameras_is_a_warning(caplog):
    world = world_of(scene(""))
    assert "the model has no camera: nothing is published" in caplog.text
    assert not world.transport.publishers


def test_a_camera_s_name_becomes_a_ros_name_and_its_frame_keeps_the_model_s_spelling(caplog):
    caplog.set_level(logging.INFO)
    size = 'resolution="16 12"'
    cameras = "".join(f'<camera name="{name}" {size}/>' for name in ("y-axis", "y_axis", "y.axis", "2nd", "walker/eye"))
    world = world_of(scene(cameras), **{"y.axis": {"policy": "polled"}, "2nd": {"frame_name": "second"}})
    world.loop.step(100)
    frames = {
        token: world.published(f"/cameras/{token}/color")[0].header.frame_id
        for token in ("y_axis", "y_axis_2", "_2nd", "walker_eye")
    }
    assert frames == {
        "y_axis": "y_axis_frame",
        "y_axis_2": "y-axis_frame",
        "_2nd": "second",
        "walker_eye": "walker/eye_frame",
    }
    assert world.transport.services == {"/cameras/y_axis_3/trigger"}
    assert (
        "camera names changed to valid ROS names in topics and services: 'y-axis' -> y_axis_2, 'y.axis' -> y_axis_3, "
        "'2nd' -> _2nd, 'walker/eye' -> walker_eye"
    ) in caplog.text
    for name in (*world.transport.publishers, *world.transport.services):
        validate_name(name)


def test_a_topic_that_ros_does_not_allow_is_refused_with_the_camera():
    world = World(mujoco.MjModel.from_xml_string(scene('<camera name="front-left" resolution="16 12"/>')))
    rules = partial(resolve, namespace="", node="cameras")
    host = Host("cameras", world.loop, world.transport, rules, world.workers, world.diagnostics)
    with pytest.raises(PluginError) as caught:
        Camera().init(host, CameraParameters(**{"front-left": {"image_topic": "front-left"}}))
    assert str(caught.value).startswith("camera 'front-left': '/cameras/front-left' is not a valid ROS name")


WRONG = [
    (("frame_name: camera_color", "frame_nam: camera_color"), 8, "camera.frame_nam: unknown key; known: depth_topic"),
    (("camera_publish_rate: 6.0", "camera_publish_rat: 6.0"), 6, "camera_publish_rat: unknown key; known: background,"),
    (("camera_publish_rate: 6.0", "camera_publish_rate: 0"), 6, "camera_publish_rate: Input should be greater than 0"),
    (("camera_publish_rate: 6.0", "quality: best"), 6, "quality: Input should be"),
    (("camera_publish_rate: 6.0", "geom_groups: [0, 6]"), 6, "geom_groups"),
    (("info_topic: /camera/color/camera_info", "policy: pulled"), 9, "camera.policy: Input should be"),
    (("info_topic: /camera/color/camera_info", "width: 0"), 9, "camera.width: Input should be greater than or equal"),
    (("info_topic: /camera/color/camera_info", "publish_rate: -1"), 9, "camera.publish_rate: Input should be greater"),
]


@pytest.mark.parametrize(("change", "line", "sentence"), WRONG, ids=[w[2] for w in WRONG])
def test_a_wrong_parameter_is_reported_in_its_place(tmp_path, change, line, sentence):
    assert change[0] in DEMO
    with pytest.raises(ConfigError) as caught:
        selected_of(tmp_path, DEMO.replace(*change))
    found = [(p.mark.line, p.message.removeprefix("plugins.mujoco_camera_plugin.")) for p in caught.value.problems]
    assert any(at == line and message.startswith(sentence) for at, message in found), found


def test_everything_can_be_set_in_yaml(tmp_path):
    selected = selected_of(
        tmp_path,
        """\
        plugins:
          cameras:
            type: camera
            quality: full
            background: far
            sync: true
            jpeg_quality: 80
            geom_groups: [0, 3]
            site_groups: [1]
            front: {policy: polled, publish_rate: 30, width: 320, height: 240, segmentation: body}
        """,
    )
    assert selected.parameters.geom_groups == (0, 3)
    assert selected.parameters.__pydantic_extra__["front"].segmentation == "body"


@pytest.mark.parametrize(
    ("environment", "platform", "tried"),
    [
        ({}, "linux", ["egl", "osmesa"]),
        ({"DISPLAY": ":0"}, "linux", ["glfw", "egl", "osmesa"]),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", ["glfw", "egl", "osmesa"]),
        ({"DISPLAY": ":0", "MUJOCO_GL": "osmesa"}, "linux", ["osmesa"]),
        ({"MUJOCO_GL": "disable"}, "linux", ["disable"]),
        ({}, "darwin", [""]),
    ],
)
def test_a_display_comes_first_and_the_user_s_choice_is_the_only_one(environment, platform, tried):
    assert [changes[BACKEND_VARIABLE] for changes in environments(environment, platform)] == tried


@pytest.mark.parametrize(
    ("backend", "remedy"),
    [
        ("egl", "no OpenGL through EGL (apt-get install libegl1 libgl1): "),
        ("osmesa", "no OpenGL through OSMesa (apt-get install libosmesa6): "),
    ],
)
@pytest.mark.parametrize(
    "error", [AttributeError("'NoneType' has no attribute 'eglQueryString'"), ImportError("no"), TypeError("x\n  y")]
)
def test_whatever_a_missing_library_raises_the_packages_are_named(monkeypatch, backend, remedy, error):
    def fail(name):
        raise error

    monkeypatch.setenv(BACKEND_VARIABLE, backend)
    monkeypatch.setattr("mjplug_plugins.camera.gl.importlib", SimpleNamespace(import_module=fail))
    with pytest.raises(UnavailableError) as caught:
        GlContext(16, 16)
    assert str(caught.value).startswith(f"{remedy}{type(error).__name__}: ")
    assert "\n" not in str(caught.value)


def test_rendering_can_be_switched_off(monkeypatch):
    monkeypatch.setenv(BACKEND_VARIABLE, "disable")
    with pytest.raises(UnavailableError, match="rendering is disabled by MUJOCO_GL=disable"):
        GlContext(16, 16)


def test_a_way_to_opengl_that_nobody_knows_is_named_with_the_known_ones(monkeypatch):
    monkeypatch.setenv(BACKEND_VARIABLE, "crayons")
    with pytest.raises(UnavailableError, match="MUJOCO_GL is 'crayons'; allowed: egl, osmesa, glfw, disable"):
        GlContext(16, 16)


def test_what_glfw_warns_of_without_a_display_is_the_reason(monkeypatch):
    class Windowless:
        def __init__(self, width, height):
            warnings.warn("X11: The DISPLAY environment variable is missing", UserWarning, stacklevel=1)

        def make_current(self):
            pass

        free = make_current

    def load(name):
        return SimpleNamespace(GLContext=Windowless, glGetString=lambda name: None, GL_RENDERER=0)

    monkeypatch.setenv(BACKEND_VARIABLE, "glfw")
    monkeypatch.setattr("mjplug_plugins.camera.gl.importlib", SimpleNamespace(import_module=load))
    with pytest.raises(UnavailableError, match=r"no OpenGL through GLFW .* UserWarning: X11: The DISPLAY environment"):
        GlContext(16, 16)


def test_a_driver_in_software_is_known_as_such(gl):  # noqa: F811
    context = GlContext(16, 16)
    assert context.backend == {"egl": "EGL", "osmesa": "OSMesa"}[gl]
    context.renderer = "llvmpipe (LLVM 15.0.6, 256 bits)"
    assert context.in_software
    context.renderer = "NVIDIA GeForce RTX 4090/PCIe/SSE2"
    assert not context.in_software
    context.close()
    context.close()
