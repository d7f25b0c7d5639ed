"""The server's own services, from outside: pause, steps, resets, placing bodies; and the list of everything."""

import re

import pytest
from cli.client import wrench

HASHES = {
    "ApplyExternalWrench": "RIHS01_3ced9bbef0a495b94e0ebe367964b04cd15ff52376462634600793fb05026982",
    "ResetWorld": "RIHS01_d569b8d8f99469310318742fd4c9c54a39bce8c2b988eed54acd48bb8ce8cd3d",
    "SetFreeJointState": "RIHS01_f2c3b8c307d3cdbc55715aaacb1c3f27e6b78a435129b3787971027664744581",
    "SetPause": "RIHS01_1986432cfda29853ee9fd682f7c3d5b39a5af49f3b15e54de4f0e5a0db46d082",
    "StepSimulation": "RIHS01_362a1ee77a9c33e2680f5d71c5fb73b487e574ed3b5e570f45ae7239bcaee3e7",
    "Trigger": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "MarkerArray": "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "Twist": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
}
"""RIHS01 hashes that ROS 2 itself computes for these types."""


def free_body(name, position, orientation=(0.0, 0.0, 0.0, 1.0), linear=(0.0, 0.0, 0.0), angular=(0.0, 0.0, 0.0)):
    def vector(values):
        return dict(zip("xyz", values, strict=True))

    return {
        "name": name,
        "pose": {"pose": {"position": vector(position), "orientation": dict(zip("xyzw", orientation, strict=True))}},
        "twist": {"twist": {"linear": vector(linear), "angular": vector(angular)}},
    }


def test_a_running_simulation_stops_at_pause_and_continues_after_it(world):
    client = world.client
    start = world.state()["step"]
    assert client.do("mjplug/set_pause", paused=False) == "the simulation is now running"
    clock = client.listen("clock/@json")
    clock.until(lambda tick: tick["clock"]["sec"] * 10**9 + tick["clock"]["nanosec"] >= (start + 10) * 2_000_000)
    assert client.do("mjplug/set_pause", paused=True) == "the simulation is now paused"
    standing = world.state()["step"]
    assert standing >= start + 10
    assert client.do("mjplug/set_pause", paused=True) == "the simulation is already paused"
    assert world.state()["step"] == standing


def test_exactly_as_many_steps_are_taken_as_asked_for(world):
    before = world.state()
    message = world.client.do("mjplug/step_simulation", steps=1234)
    after = world.state()
    assert after["step"] == before["step"] + 1234
    assert after["time_ns"] == after["step"] * 2_000_000
    assert message == f"took 1234 steps; t = {after['step'] * 0.002:.6f} s"


def test_steps_are_refused_while_the_simulation_runs(world):
    world.client.do("mjplug/set_pause", paused=False)
    assert world.client.ask("mjplug/step_simulation", steps=1) == {
        "success": False,
        "message": "the simulation is running; pause it first (~/set_pause, or mjplug sim pause)",
    }


def test_steps_that_a_resume_interrupts_are_answered_with_what_was_done(world):
    steps = world.client.request("mjplug/step_simulation", steps=4_000_000_000)
    world.client.do("mjplug/set_pause", paused=False)
    response = steps.answer().json
    assert response["success"] is False
    assert response["message"].startswith("interrupted: the simulation was resumed (")
    assert response["message"].endswith(" of 4000000000 steps were taken)")


def test_a_reset_puts_a_keyframe_back_and_lets_time_continue(world):
    world.step(100)
    before = world.state()
    message = world.client.do("mjplug/reset_world", keyframe="apart")
    after = world.state()
    assert message == "the world was reset to keyframe 'apart'"
    assert after["qpos"] == [1, 2, 3, 1, 0, 0, 0, 5, 0, 1, 1, 0, 0, 0, 9, 0, 1, 1, 0, 0, 0, 0.5]
    assert (after["time_ns"], after["epoch"]) == (before["time_ns"], before["epoch"] + 1)


def test_a_reset_takes_overrides(world):
    response = world.client.ask(
        "mjplug/reset_world",
        state_overrides={
            "joint_states": {"name": ["hinge"], "position": [0.25], "velocity": [-1.5]},
            "free_joints": [free_body("link_a", (1.0, 2.0, 3.0), linear=(0.1, 0.2, 0.3))],
        },
    )
    assert response == {
        "success": True,
        "message": "the world was reset to its initial state with 1 joint override and 1 free body override",
    }
    state = world.state()
    assert (state["qpos"][21], state["qvel"][18]) == (0.25, -1.5)
    assert (state["qpos"][7:10], state["qvel"][6:9]) == ([1.0, 2.0, 3.0], [0.1, 0.2, 0.3])


def test_a_reset_ends_pushes_and_answers_waiting_calls(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0), seconds=1000.0))
    world.step(10)
    world.client.do("mjplug/reset_world")
    assert push.answer().json == {"success": False, "message": "cancelled: the world was reset"}
    world.step(10)
    assert world.state()["qvel"] == [0.0] * 19


def test_an_unknown_keyframe_is_refused_with_the_known_ones(world):
    before = world.state()
    assert world.client.ask("mjplug/reset_world", keyframe="apartt") == {
        "success": False,
        "message": "unknown keyframe 'apartt', did you mean 'apart'?; known: apart; the world was not reset",
    }
    assert world.state() == before


def test_a_free_body_is_placed_and_moves_on_from_there(world):
    half = 0.5**0.5
    placed = free_body(
        "link_b", (1.0, -2.0, 0.5), orientation=(0.0, 0.0, half, half), linear=(1.0, 0.0, 0.0), angular=(2.0, 0.0, 0.0)
    )
    assert world.client.do("mjplug/set_free_joint_state", free_joints=[placed]) == "set the state of 1 body"
    state = world.state()
    assert state["qpos"][14:21] == pytest.approx([1.0, -2.0, 0.5, half, 0, 0, half], rel=1e-12)
    # MuJoCo keeps a free joint's angular velocity in the body's frame, which is turned by 90° about z.
    assert state["qvel"][12:18] == pytest.approx([1.0, 0, 0, 0, -2.0, 0], rel=1e-12, abs=1e-12)
    world.step(500)
    assert world.state()["qpos"][14] == pytest.approx(2.0, rel=1e-9)


def test_all_bodies_are_placed_or_none(world):
    before = world.state()
    response = world.client.ask(
        "mjplug/set_free_joint_state",
        free_joints=[free_body("link_a", (1.0, 1.0, 1.0)), free_body("door", (1.0, 1.0, 1.0))],
    )
    assert response == {"success": False, "message": "free_joints[1] ('door'): body 'door' has no free joint"}
    assert world.state() == before


def test_the_list_of_interfaces_has_every_key_with_type_hash_and_qos(world):
    listing = world.client.ask("mjplug/interfaces")
    assert (listing["name"], listing["endpoint"]) == ("/mjplug", world.server.endpoint)
    standard = {s["key"] for s in listing["services"] if s["type"].startswith("simulation_interfaces/")}
    assert {"get_entities", "spawn_entity", "set_simulation_state"} < standard
    assert {s["key"]: s["type"] for s in listing["services"] if s["key"] not in standard} == {
        "mjplug/set_model_values": "mjplug_msgs/srv/SetModelValues",
        "mjplug/set_pause": "mujoco_ros2_control_msgs/srv/SetPause",
        "mjplug/step_simulation": "mujoco_ros2_control_msgs/srv/StepSimulation",
        "mjplug/reset_world": "mujoco_ros2_control_msgs/srv/ResetWorld",
        "mjplug/set_free_joint_state": "mujoco_ros2_control_msgs/srv/SetFreeJointState",
        "mjplug/save_state": "mjplug_msgs/srv/SaveState",
        "mjplug/restore_state": "mjplug_msgs/srv/RestoreState",
        "mjplug/list_states": "mjplug_msgs/srv/ListStates",
        "mjplug/delete_state": "mjplug_msgs/srv/DeleteState",
        "mjplug/get_state_digest": "mjplug_msgs/srv/GetStateDigest",
        "mjplug/step": "mjplug_msgs/srv/Step",
        "mjplug/rollout": "mjplug_msgs/srv/Rollout",
        "external_wrench/apply_wrench": "mujoco_ros2_control_msgs/srv/ApplyExternalWrench",
        "probe/state": "std_srvs/srv/Trigger",
        "mjplug/describe_parameters": "rcl_interfaces/srv/DescribeParameters",
        "mjplug/get_diagnostics": "std_srvs/srv/Trigger",
        "mjplug/get_parameter_types": "rcl_interfaces/srv/GetParameterTypes",
        "mjplug/get_parameters": "rcl_interfaces/srv/GetParameters",
        "mjplug/list_parameters": "rcl_interfaces/srv/ListParameters",
        "mjplug/set_parameters": "rcl_interfaces/srv/SetParameters",
        "mjplug/set_parameters_atomically": "rcl_interfaces/srv/SetParametersAtomically",
    }
    assert {(t["key"], t["json_key"], t["direction"]): t["type"] for t in listing["topics"]} == {
        ("clock", "clock/@json", "published"): "rosgraph_msgs/msg/Clock",
        ("diagnostics", "diagnostics/@json", "published"): "diagnostic_msgs/msg/DiagnosticArray",
        ("mjplug/epoch", "mjplug/epoch/@json", "published"): "std_msgs/msg/UInt64",
        ("mjplug/model_changed", "mjplug/model_changed/@json", "published"): "mjplug_msgs/msg/ModelChanged",
        ("rosout", "rosout/@json", "published"): "rcl_interfaces/msg/Log",
        ("external_wrench/wrench_markers", "external_wrench/wrench_markers/@json", "published"):
            "visualization_msgs/msg/MarkerArray",
        ("mujoco_heartbeat", "mujoco_heartbeat/@json", "published"): "std_msgs/msg/String",
        ("probe/twist", "probe/twist/@json", "subscribed"): "geometry_msgs/msg/Twist",
    }  # fmt: skip
    entries = [*listing["services"], *listing["topics"]]
    assert all(entry["name"] == f"/{entry['key']}" for entry in entries)
    own = [entry for entry in entries if entry["key"] not in standard]
    hashes = {entry["type"].rpartition("/")[2]: entry["hash"] for entry in own}
    assert {name: hashes[name] for name in HASHES} == HASHES
    assert all(re.fullmatch("RIHS01_[0-9a-f]{64}", digest) for digest in hashes.values())
    qos = {t["key"]: t["qos"] for t in listing["topics"]}
    assert qos["clock"] == {"depth": 1, "reliability": "best_effort", "durability": "volatile"}
    assert qos["mjplug/epoch"] == {"depth": 1, "reliability": "reliable", "durability": "transient_local"}
    assert qos["mujoco_heartbeat"] == {"depth": 10, "reliability": "reliable", "durability": "volatile"}


def test_diagnostics_come_while_paused_and_report_steps_and_resets(world):
    listener = world.client.listen("diagnostics/@json")

    def figures(message):
        return {status["name"]: {v["key"]: v["value"] for v in status["values"]} for status in message["status"]}

    before = figures(listener.next())
    assert {"mjplug: simulation", "mjplug: wire"} <= before.keys()
    assert before["mjplug: wire"]["endpoint"] == world.server.endpoint
    assert before["mjplug: simulation"]["state"] == "paused"
    world.client.do("mjplug/step_simulation", steps=150)
    world.client.do("mjplug/reset_world")
    steps, resets = (int(before["mjplug: simulation"][key]) for key in ("steps", "resets"))
    expected = {"steps": str(steps + 150), "resets": str(resets + 1), "state": "paused"}
    message = listener.until(lambda message: expected.items() <= figures(message)["mjplug: simulation"].items())
    stamp = message["header"]["stamp"]
    time = stamp["sec"] + stamp["nanosec"] / 1e9
    assert figures(message)["mjplug: simulation"]["simulated time (s)"] == f"{time:.6f}"
    assert {status["hardware_id"] for status in message["status"]} == {"/mjplug"}


def test_the_list_of_interfaces_has_definitions_and_schemas_on_request(world):
    types = world.client.ask("mjplug/interfaces?schema=true")["types"]
    pause = types["mujoco_ros2_control_msgs/srv/SetPause"]
    assert [line for line in pause["definition"].splitlines() if line and not line.startswith("#")] == [
        "bool paused", "---", "bool success", "string message",
    ]  # fmt: skip
    assert pause["request"]["properties"]["paused"]["type"] == "boolean"
    assert {"linear", "angular"} == set(types["geometry_msgs/msg/Twist"]["schema"]["properties"])


def test_services_answer_one_after_the_other_in_the_order_of_the_requests(world):
    first = world.state()["step"]
    pending = [world.client.request("mjplug/step_simulation", steps=7) for _ in range(10)]
    ends = [p.answer().json["message"] for p in pending]
    assert ends == [f"took 7 steps; t = {(first + 7 * (i + 1)) * 0.002:.6f} s" for i in range(10)]
