"""The main job: heartbeats arrive, and a push lasts exactly as long as asked, in simulated time."""

import re

import pytest
from cli.client import Client, wrench, wrenches
from cli.process import Served

DT = 0.002


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    server = Served(
        "bundled:box", "--speed", "20", "--plugin", "heartbeat", "--plugin", "external_wrench",
        cwd=tmp_path_factory.mktemp("box"),
    )  # fmt: skip
    yield server
    server.kill()


@pytest.fixture(scope="module")
def client(box):
    with Client(box.endpoint) as client:
        yield client


def seconds(clock):
    return clock["clock"]["sec"] + clock["clock"]["nanosec"] / 1e9


def test_the_ready_line_names_the_endpoint_the_model_and_the_plugins(box):
    assert re.fullmatch(
        r"ready · tcp/127\.0\.0\.1:\d+ · model box \(.*\) · plugins: heartbeat, external_wrench · speed 20\n", box.ready
    )


def test_heartbeats_count_and_contain_the_simulated_time_in_the_documented_format(client):
    beats = client.listen("mujoco_heartbeat/@json")
    texts = [beats.next()["data"] for _ in range(3)]
    first = int(re.search(r"#(\d+)", texts[0])[1])
    assert texts == [
        f"MuJoCo ROS2 Control Heartbeat #{first + i} | Simulation time: {first + i + 1:.6f}s" for i in range(3)
    ]


def test_the_documented_push_succeeds_after_its_two_seconds(client):
    request = {
        "wrenches": {
            "external_wrenches": [
                {
                    "wrench": {
                        "header": {"frame_id": "box"},
                        "wrench": {"force": {"x": 10.0, "y": 0.0, "z": 0.0}, "torque": {"x": 0.0, "y": 0.0, "z": 0.0}},
                    },
                    "application_point": {"x": 0.1, "y": 0.0, "z": 0.0},
                    "duration": {"sec": 2, "nanosec": 0},
                    "ramp_down_duration": {"sec": 0, "nanosec": 500000000},
                }
            ]
        }
    }
    ticks = client.listen("clock/@json")
    before = seconds(ticks.next())
    response = client.ask("external_wrench/apply_wrench", **request)
    assert response == {"success": True, "message": "applied 1 wrench, the longest for 2 s"}
    client.do("mjplug/set_pause", paused=True)
    taken = client.do("mjplug/step_simulation", steps=1)
    assert float(re.search(r"t = ([\d.]+) s", taken)[1]) >= before + 2.0
    client.do("mjplug/set_pause", paused=False)


def test_arrows_show_a_push_while_it_lasts_and_are_deleted_at_its_end(client):
    markers = client.listen("external_wrench/wrench_markers/@json")
    push = wrench("box", force=(100.0, 0.0, 0.0), torque=(0.0, 0.0, 1.0), point=(0.0, 0.1, 0.0), seconds=4.0)
    client.do("external_wrench/apply_wrench", **wrenches(push))
    shown = markers.next()["markers"]
    gone = markers.until(lambda message: any(marker["action"] == 2 for marker in message["markers"]))["markers"]
    assert [(m["ns"], m["header"]["frame_id"], m["action"]) for m in shown] == [
        ("external_wrench/force", "box", 0),
        ("external_wrench/torque", "box", 0),
    ]
    assert shown[0]["points"] == [{"x": 0.0, "y": 0.1, "z": 0.0}, {"x": 1.0, "y": 0.1, "z": 0.0}]
    assert shown[1]["points"] == [{"x": 0.0, "y": 0.1, "z": 0.0}, {"x": 0.0, "y": 0.1, "z": 0.1}]
    assert [(m["ns"], m["id"], m["action"]) for m in gone] == [(m["ns"], m["id"], 2) for m in shown]


def test_a_push_is_answered_at_exactly_the_step_that_ends_it(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0), seconds=0.1))
    world.step(49)
    assert not push.answered
    assert world.state()["xfrc"][1][0] == 10.0
    world.step(1)
    assert push.answer().json == {"success": True, "message": "applied 1 wrench, the longest for 0.1 s"}
    assert world.state()["xfrc"][1][0] == 0.0


def test_a_push_without_duration_acts_for_a_single_step(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0)))
    world.step(1)
    assert push.answer().json["success"] is True
    world.step(10)
    assert world.state()["qvel"][0] == pytest.approx(10.0 / 2 * DT, rel=1e-12)


def test_the_body_gets_the_impulse_of_the_force_and_its_ramp(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0), point=(0.1, 0.0, 0.0), seconds=2.0, ramp=0.5))
    world.step(1000)
    assert push.answer().json["success"] is True
    # 750 steps at full force, then 250 steps on which it falls linearly, sampled at the start of each.
    scales = [1.0] * 750 + [1.0 - i / 250 for i in range(250)]
    velocity = position = 0.0
    for scale in scales:
        velocity += 10.0 / 2 * scale * DT
        position += velocity * DT
    state = world.state()
    assert state["qvel"][:6] == pytest.approx([velocity, 0, 0, 0, 0, 0], rel=1e-9, abs=1e-12)
    assert state["qpos"][:7] == pytest.approx([position, 0, 1, 1, 0, 0, 0], rel=1e-9, abs=1e-12)


def test_two_pushes_in_one_call_act_together_and_end_each_at_its_own_time(world):
    push = world.send_push(
        wrench("link_a", force=(5.0, 0.0, 0.0), seconds=0.2), wrench("link_b", force=(0.0, -3.0, 0.0), seconds=0.1)
    )
    world.step(51)
    forces = world.state()["xfrc"]
    assert (forces[2][0], forces[3][1]) == (5.0, 0.0)
    world.step(48)
    assert not push.answered
    world.step(1)
    assert push.answer().json == {"success": True, "message": "applied 2 wrenches, the longest for 0.2 s"}
    world.step(100)
    velocities = world.state()["qvel"]
    assert velocities[6:9] == pytest.approx([5.0 / 1 * 0.2, 0, 0], rel=1e-9, abs=1e-12)
    assert velocities[12:15] == pytest.approx([0, -3.0 / 3 * 0.1, 0], rel=1e-9, abs=1e-12)


def test_a_push_without_wait_is_answered_at_once_and_lasts_as_long(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0), seconds=0.1), parameters="?wait=false")
    assert push.answer().json == {"success": True, "message": "applying 1 wrench, the longest for 0.1 s"}
    world.step(100)
    assert world.state()["qvel"][0] == pytest.approx(10.0 / 2 * 0.1, rel=1e-9)


def test_a_wrong_wait_parameter_is_refused(world):
    push = world.send_push(wrench("base_link", force=(10.0, 0.0, 0.0), seconds=0.1), parameters="?wait=no")
    assert push.answer().json == {"success": False, "message": "parameter wait is 'no'; allowed: true, false"}
    world.step(1)
    assert world.state()["qvel"][0] == 0.0


def test_one_unknown_body_refuses_the_whole_request(world):
    push = world.send_push(
        wrench("link_a", force=(5.0, 0.0, 0.0), seconds=1.0), wrench("link_c", force=(5.0, 0.0, 0.0), seconds=1.0)
    )
    assert push.answer().json == {
        "success": False,
        "message": "external_wrenches[1]: unknown body 'link_c', did you mean 'link_a'?; "
        "known: base_link, door, hand, link_a, link_b, post, world; nothing was applied",
    }
    world.step(5)
    assert world.state()["qvel"] == [0.0] * 19
