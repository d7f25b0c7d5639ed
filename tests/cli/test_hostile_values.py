"""Requests that are well formed and wrong: refused whole, with the reason."""

import json
import math

import pytest
import zenoh
from cli.attack import VALID, paths, refused, replaced
from cli.client import JSON, wrench, wrenches

from mjplug_schemas.registry import find

CDR = zenoh.Encoding.APPLICATION_CDR
NOT_FINITE = (math.nan, math.inf, -math.inf)

FLOATS = [
    (key, path)
    for key in ("external_wrench/apply_wrench", "mjplug/set_free_joint_state", "mjplug/reset_world")
    for path in paths(VALID[key], (float, int))
    if path[-1] not in ("sec", "nanosec")
]


def test_nan_or_infinity_anywhere_refuses_the_whole_request(target):
    types = {entry["key"]: find(entry["type"]) for entry in target.client.ask("mjplug/interfaces")["services"]}
    assert len(FLOATS) == 9 + 13 + 2 + 13
    for key, path in FLOATS:
        for value in NOT_FINITE:
            text = json.dumps(replaced(VALID[key], path, value))
            in_json = refused(target.client.send(key, text, JSON))
            in_cdr = refused(target.client.send(key, types[key].Request.from_json(text).to_cdr(), CDR))
            assert in_json == in_cdr
            assert "finite" in in_json, (key, path, value)


WRONG = (None, "text", 1.5, -1, 2**70, True, [], {}, [[]], {"x": {}})


def test_values_of_another_type_are_refused_with_the_name_of_their_field(target):
    for key, request in VALID.items():
        for path in paths(request, (float, int, str, bool)):
            right = request
            for name in path:
                right = right[name]
            for value in WRONG:
                if type(value) is type(right) or (isinstance(right, float | int) and isinstance(value, float | int)):
                    continue
                sentence = refused(target.client.send(key, json.dumps(replaced(request, path, value)), JSON))
                assert str(path[-1]) in sentence, (key, path, value)


@pytest.mark.parametrize("steps", [-1, 2**32, 1.5, 1e3, "1", True, None, [1]], ids=repr)
def test_steps_that_are_no_number_of_steps_are_refused(target, steps):
    assert "steps must be a uint32" in refused(target.client.request("mjplug/step_simulation", steps=steps))


def test_names_that_the_model_does_not_have_are_refused(target):
    for name in (
        "",
        "link_c",
        "LINK_A",
        "link_a\n",
        "link_a/../link_b",
        "*",
        "x" * 100_000,
        "a\u0000b",
        "\u202e",
        "💥",
    ):
        body = json.dumps(replaced(VALID["mjplug/set_free_joint_state"], ("free_joints", 0, "name"), name))
        refused(target.client.send("mjplug/set_free_joint_state", body, JSON))
        refused(target.client.request("external_wrench/apply_wrench", **wrenches(wrench(name, seconds=0.1))))
        if name:
            refused(target.client.request("mjplug/reset_world", keyframe=name))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        (wrench("post", seconds=1.0), "body 'post' is fixed to the world, so a wrench cannot move it"),
        (wrench("world", seconds=1.0), "body 'world' is the world, so a wrench cannot move it"),
        (wrench("link_a", seconds=-1.0), "duration is -1 s; it must not be negative"),
        (wrench("link_a", ramp=-0.5), "ramp_down_duration is -0.5 s; it must not be negative"),
        (wrench("link_a", seconds=1.0, ramp=2.0), "ramp_down_duration (2 s) must not exceed duration (1 s)"),
    ],
)
def test_wrenches_that_cannot_be_applied_are_refused_with_those_beside_them(target, fields, reason):
    good = wrench("link_b", force=(1.0, 0.0, 0.0), seconds=1.0)
    pending = target.client.request("external_wrench/apply_wrench", **wrenches(good, fields, good))
    assert refused(pending) == f"external_wrenches[1]: {reason}; nothing was applied"


def test_a_body_that_follows_a_mocap_pose_cannot_be_pushed(target):
    push = target.client.request("external_wrench/apply_wrench?wait=false", **wrenches(wrench("hand", seconds=0.1)))
    assert refused(push).endswith("a wrench cannot move it; nothing was applied")


def test_odd_parameters_of_a_request_are_refused_or_ignored(target):
    push = json.dumps(wrenches(wrench("nobody")))
    for selector in ("?wait=%00", "?wait", "?=;;=;", "?" + "a=b;" * 10_000, "?wait=true;wait=false", "?wait=%ff%zz"):
        refused(target.client.send(f"external_wrench/apply_wrench{selector}", push, JSON))


def test_forces_beyond_all_bounds_pause_the_simulation_and_a_reset_repairs_it(attacked):
    client = attacked.client
    start = attacked.state()
    push = client.request(
        "external_wrench/apply_wrench", **wrenches(wrench("link_a", force=(1e300, 0, 0), seconds=9.0))
    )
    attacked.server.err.wait_for("the simulation diverged .* paused before that step")
    assert client.do("mjplug/set_pause", paused=True) == "the simulation is already paused"
    assert not push.answered
    client.do("mjplug/reset_world")
    assert push.answer().json == {"success": False, "message": "cancelled: the world was reset"}
    assert client.do("mjplug/set_pause", paused=False) == "the simulation is now running"
    assert attacked.state()["qpos"] == start["qpos"]
