"""`mjplug.testing.assert_message`: what is equal, and what an error says."""

import math

import numpy as np
import pytest

from mjplug.testing import assert_message
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.sensor_msgs import Image, JointState
from mjplug_schemas.std_msgs import Bool, Float64, Header, String


def refusal(*arguments, **options):
    with pytest.raises(AssertionError) as refused:
        assert_message(*arguments, **options)
    return str(refused.value)


def test_equal_messages_pass_within_the_tolerance():
    twist = Twist(linear=Vector3(x=0.5, z=-1e-13))
    assert_message(twist, Twist(linear=Vector3(x=0.5 * (1 + 1e-10))))
    assert_message(twist, {"linear": {"x": 0.6}}, abs=0.11)
    assert_message(twist, {"linear": {"x": 0.55}}, rel=0.1)
    assert_message(Float64(data=math.nan), Float64(data=math.nan))
    assert_message(Float64(data=math.inf), {"data": math.inf})
    assert_message(Float64(), {})


def test_a_difference_is_named_by_its_path_with_both_values():
    twist = Twist(linear=Vector3(x=0.5), angular=Vector3(z=1.0))
    assert refusal(twist, {"linear": {"x": 0.6, "y": 0.0}, "angular": {"z": 2}}) == (
        "geometry_msgs/msg/Twist:\n  linear.x: 0.5, expected 0.6\n  angular.z: 1.0, expected 2"
    )
    assert refusal(Float64(data=math.nan), {"data": 0.0}).endswith("data: nan, expected 0.0")
    assert refusal(Float64(data=0.0), {"data": 1e-11}).endswith("data: 0.0, expected 1e-11")
    assert refusal(String(data="a"), {"data": "b"}).endswith("data: 'a', expected 'b'")
    assert refusal(Bool(data=True), {"data": False}).endswith("data: True, expected False")


def test_sequences_are_compared_item_by_item_and_by_their_length():
    state = JointState(name=("a", "b"), position=(1.0, 2.0), header=Header(frame_id="base"))
    assert_message(state, {"position": [1.0, 2.0], "name": ["a", "b"]})
    assert_message(state, {"position": np.array([1.0, 2.0])})
    assert refusal(state, {"position": [1.0, 2.5]}).endswith("position[1]: 2.0, expected 2.5")
    assert refusal(state, {"position": [1.0]}).endswith("position: 2 values, expected 1")
    assert refusal(state, {"name": ("a", "c")}).endswith("name[1]: 'b', expected 'c'")
    image = Image(height=1, width=2, data=b"\x01\x02")
    assert_message(image, {"data": b"\x01\x02"})
    assert "data: " in refusal(image, {"data": b"\x01\x03"})


def test_another_type_and_an_unknown_field_are_named():
    assert refusal(Float64(), Bool()) == "the message is std_msgs/msg/Float64, not std_msgs/msg/Bool"
    assert refusal(Twist(), {"linear": {"w": 1.0}}).endswith(
        "linear.w: geometry_msgs/msg/Vector3 has no such field; fields: x, y, z"
    )


def test_many_differences_are_counted():
    long = JointState(position=tuple(float(i) for i in range(30)))
    text = refusal(long, {"position": [-1.0] * 30})
    assert text.count("expected") == 10
    assert text.endswith("… and 20 more")
