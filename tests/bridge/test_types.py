"""Types that this ROS installation does not have, or has otherwise."""

import sys

import pytest
from bridge.installation import install, write_hash
from bridge.process import REAL

from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.std_msgs import String


@pytest.fixture
def opt(tmp_path):
    return tmp_path / "opt"


@pytest.fixture
def ros_types(installation, opt, monkeypatch):
    """The module, with an installation in `opt` that is found first."""
    from mjplug_bridge_ros2 import ros_types

    before = set(sys.modules)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(opt))
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    yield ros_types
    for name in set(sys.modules) - before:
        del sys.modules[name]


def refusal(ros_types, type_name, hash=""):
    from mjplug_bridge_ros2.errors import TypeRefused

    with pytest.raises(TypeRefused) as caught:
        ros_types.find_type(type_name, hash)
    return str(caught.value)


@pytest.mark.parametrize("distribution", ["humble", "lyrical"])
def test_a_package_that_is_missing_is_named_as_apt_does(ros_types, monkeypatch, distribution):
    monkeypatch.setenv("ROS_DISTRO", distribution)
    sentence = refusal(ros_types, "no_such_msgs/srv/SetPause")
    assert "package no_such_msgs is not installed" in sentence
    assert f"`sudo apt install ros-{distribution}-no-such-msgs`" in sentence


def test_an_older_package_may_lack_a_type(ros_types, opt):
    (opt / "share" / "old_msgs" / "srv").mkdir(parents=True)
    assert "the installed old_msgs has no srv/SetPause" in refusal(ros_types, "old_msgs/srv/SetPause")


@pytest.mark.parametrize(
    "name", ["os/path/Join", "std_msgs/String", "std_msgs/msg/../x", "os.path/msg/X", "a_msgs/action/X", ""]
)
def test_what_is_no_type_name_is_not_even_imported(ros_types, name):
    assert "is not the name of a ROS message, service or part of an action" in refusal(ros_types, name)


def test_a_definition_with_another_hash_is_refused(ros_types, opt):
    install(opt)
    genuine = type_hash(String)
    assert ros_types.find_type("std_msgs/msg/String", genuine).__name__ == "String"
    other = f"RIHS01_{'0' * 64}"
    write_hash(opt, "std_msgs/msg/String", other)
    sentence = refusal(ros_types, "std_msgs/msg/String", genuine)
    assert "std_msgs defines msg/String differently" in sentence
    assert genuine in sentence
    assert other in sentence


def test_without_hashes_as_on_humble_the_name_has_to_do(ros_types, opt):
    install(opt, hashes=False)
    assert ros_types.find_type("std_msgs/msg/String", type_hash(String)).__name__ == "String"


@pytest.mark.skipif(REAL, reason="needs an installation that can be changed")
def test_a_missing_package_disables_its_own_interfaces_only(ros, serve, bridge, opt):
    install(opt, without=["mujoco_ros2_control_msgs"])
    write_hash(opt, "geometry_msgs/msg/Twist", f"RIHS01_{'1' * 64}")
    server = serve()
    own = bridge(server.endpoint, env={"AMENT_PREFIX_PATH": str(opt)})
    own.wait_for("WARN.*/own/mjplug/reset_world .* is not mapped: same reason as above")
    own.wait_for("WARN.*/own/probe/twist .* is not mapped.*defines msg/Twist differently")
    assert own.log.text.count("`sudo apt install ros-jazzy-mujoco-ros2-control-msgs`") == 1
    inbox = ros.subscribe("/own/mujoco_heartbeat", "std_msgs/msg/String")
    assert "Heartbeat #" in String.from_cdr(inbox.next()).data
    assert ros.call("/own/probe/state", "std_srvs/srv/Trigger").success
    assert not ros.is_ready("/own/mjplug/set_pause", "mujoco_ros2_control_msgs/srv/SetPause")()
    assert ros.types("/own/probe/twist") == []


def test_failures_are_reported_if_the_type_has_a_field_for_them(installation):
    from mjplug_bridge_ros2.failure import fill_in
    from mjplug_bridge_ros2.ros_types import import_type

    response = import_type("std_srvs/srv/Trigger").Response(success=True)
    assert fill_in(response, "no")
    assert (response.success, response.message) == (False, "no")
    assert not fill_in(import_type("std_srvs/srv/Empty").Response(), "no")


def test_a_response_of_simulation_interfaces_says_operation_failed():
    from mjplug_bridge_ros2.failure import fill_in

    class Result:
        RESULT_OPERATION_FAILED = 4
        result = 0
        error_message = ""

    class Response:
        result = Result()

        @staticmethod
        def get_fields_and_field_types():
            return {"result": "simulation_interfaces/Result"}

    response = Response()
    assert fill_in(response, "no")
    assert (response.result.result, response.result.error_message) == (4, "no")
