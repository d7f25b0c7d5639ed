"""`mjplug interface show` and `proto`, in the format of ros2."""

import io
import sys

import pytest
import yaml
from cli.tour import typed

from mjplug.cli.interface_text import definition_lines
from mjplug_schemas.geometry_msgs import TwistStamped
from mjplug_schemas.registry import all_types
from mjplug_schemas.shape import nested


def shown(*words):
    done = typed("interface", *words)
    assert (done.code, done.err) == (0, "")
    return done.out


def test_types_inside_a_type_are_shown_below_their_fields():
    assert shown("show", "geometry_msgs/msg/TwistStamped", "--no-comments").splitlines() == [
        "std_msgs/Header header",
        "\tbuiltin_interfaces/Time stamp",
        "\t\tint32 sec",
        "\t\tuint32 nanosec",
        "\tstring frame_id",
        "geometry_msgs/Twist twist",
        "\tgeometry_msgs/Vector3 linear",
        *["\t\tfloat64 x", "\t\tfloat64 y", "\t\tfloat64 z"],
        "\tgeometry_msgs/Vector3 angular",
        *["\t\tfloat64 x", "\t\tfloat64 y", "\t\tfloat64 z"],
    ]


def test_comments_are_those_of_the_type_itself_unless_all_are_wanted():
    lines = shown("show", "geometry_msgs/msg/TwistStamped").splitlines()
    assert [line for line in lines if "#" in line and line.startswith("\t")] == []
    assert any(line.startswith("# ") for line in lines)
    everything = shown("show", "geometry_msgs/msg/TwistStamped", "--all-comments").splitlines()
    assert any(line.startswith("\t\t# ") for line in everything)
    assert [line for line in everything if not line.strip().startswith("#") and line.strip()] == [
        line for line in lines if not line.startswith("#") and line
    ]
    wrong = typed("interface", "show", "std_msgs/msg/String", "--all-comments", "--no-comments")
    assert wrong.code == 2
    assert "it excludes --no-comments" in wrong.err


def test_lists_of_messages_and_parts_of_services_are_expanded():
    lines = shown("show", "mujoco_ros2_control_msgs/srv/ApplyExternalWrench", "--no-comments").splitlines()
    assert "---" in lines
    assert any(line.startswith("\tmujoco_ros2_control_msgs/ExternalWrench[] ") for line in lines)
    assert any(line.startswith("\t\tgeometry_msgs/WrenchStamped ") for line in lines)


def test_every_type_is_shown_with_everything_inside_it():
    def parts(interface):
        return 1 + sum(parts(inner) for inner in nested(interface))

    for name, kind in all_types().items():
        names = [part for part in ("Request", "Response", "Goal", "Result", "Feedback") if hasattr(kind, part)]
        sections = [getattr(kind, part) for part in names] or [kind]
        lines = definition_lines(kind, comments=False)
        deep = [line for line in lines if "/" in line.split(" ")[0]]
        assert len(deep) == sum(parts(section) - 1 for section in sections), name


def test_the_type_may_come_from_another_command(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO("std_msgs/msg/Bool\n"))
    assert shown("show", "-", "--no-comments") == "bool data\n"


def test_a_prototype_is_a_message_with_its_initial_values():
    text = shown("proto", "geometry_msgs/TwistStamped", "--no-quotes")
    assert TwistStamped.model_validate(yaml.safe_load(text)) == TwistStamped()
    quoted = shown("proto", "geometry_msgs/msg/TwistStamped")
    assert quoted == f'"{text}"\n'
    assert shown("proto", "std_srvs/srv/SetBool") == '"data: false\n"\n'
    assert shown("proto", "std_srvs/srv/Trigger", "--no-quotes") == "{}\n"
    goal = shown("proto", "control_msgs/action/GripperCommand", "--no-quotes")
    assert yaml.safe_load(goal) == {"command": {"position": 0.0, "max_effort": 0.0}}


def test_an_action_is_shown_with_its_three_parts():
    parts = shown("show", "control_msgs/action/GripperCommand", "--no-comments").split("---\n")
    state = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n"
    assert parts == [
        "control_msgs/GripperCommand command\n\tfloat64 position\n\tfloat64 max_effort\n",
        state,
        state,
    ]
    # A derived type contains parts of the action.
    sent = shown("show", "control_msgs/action/GripperCommand_SendGoal", "--no-comments").splitlines()
    assert "control_msgs/GripperCommand_Goal goal" in sent


def test_the_kinds_of_types_are_listed():
    assert shown("list", "--only-actions").splitlines() == [name for name in all_types() if "/action/" in name]
    both = shown("list", "-s", "-a").splitlines()
    assert both == [name for name in all_types() if "/msg/" not in name]


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("Twist", "did you mean 'geometry_msgs/msg/Twist'?"),
        ("twist", "did you mean 'geometry_msgs/msg/Twist'?"),
        ("JointState", "did you mean 'sensor_msgs/msg/JointState'?"),
        ("Twst", "did you mean 'geometry_msgs/msg/Twist'?"),
        ("sensor_msgs/msg/Twist", "did you mean 'geometry_msgs/msg/Twist'?"),
        ("geometry_msgs/msg/Twst", "did you mean 'geometry_msgs/msg/Twist'?"),
        ("Float64", "did you mean 'std_msgs/msg/Float64'?"),
        ("Trigger", "did you mean 'std_srvs/srv/Trigger'?"),
    ],
)
@pytest.mark.parametrize("command", ["show", "proto", "hash"])
def test_a_type_without_its_package_is_guessed(command, name, meant):
    done = typed("interface", command, name)
    assert done.code == 2
    assert f"unknown type {name!r}, {meant}" in done.err
