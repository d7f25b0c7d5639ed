"""`mjplug doctor`: its report on simulated machines and on this one."""

import json
import os
import re
import socket
from importlib.metadata import PackageNotFoundError

import pytest
from cli.tour import typed

from mjplug import open_server
from mjplug.cli.doctor.environment import check_environment
from mjplug.cli.doctor.graphics import check_graphics, draw
from mjplug.cli.doctor.network import check_network
from mjplug.cli.doctor.scheduling import check_scheduling
from mjplug.cli.doctor.self_test import check_server
from mjplug.wire.endpoints import on_free_port

GOOD = {"mujoco": "3.17.0", "eclipse-zenoh": "1.10.2", "mjplug": "0.1.0"}


def versions(**changed):
    installed = GOOD | {name.replace("_", "-"): version for name, version in changed.items()}

    def version(package):
        if package not in installed:
            raise PackageNotFoundError(package)
        return installed[package]

    return version


def problems(findings):
    """Returns what is wrong: level, message, fix."""
    return [
        (finding.level, finding.message, finding.fix) for finding in findings if finding.level not in ("ok", "note")
    ]


def test_a_good_installation_has_no_problem():
    assert problems(check_environment({}, versions())) == []


@pytest.mark.parametrize(
    ("changed", "level", "says"),
    [
        ({"mujoco": "4.0.0"}, "error", "mujoco 4.0.0 computes wrong forces in large models"),
        ({"mujoco": "3.1.0"}, "warning", "mujoco 3.1.0 has not been tested with mjplug"),
        ({"mujoco": "5.0.1"}, "warning", "mujoco 5.0.1 has not been tested with mjplug"),
        (
            {"mujoco_core": "4.0.1"},
            "error",
            "two versions of MuJoCo are installed in one folder: mujoco 3.17.0 and mujoco-core 4",
        ),
    ],
)
def test_the_traps_among_versions_of_mujoco_are_known(changed, level, says):
    ((found, message, fix),) = problems(check_environment({}, versions(**changed)))
    assert (found, message.startswith(says)) == (level, True)
    assert "pip install 'mujoco>=3.13,!=4.0.0,<4.2'" in fix


def test_variables_that_would_stop_a_server_are_found_and_others_are_reported():
    wrong = {"MJPLUG_SIM__SPED": "2", "MJPLUG_MODELL": "x", "ROS_DOMAIN_ID": "999", "MJPLUG_CONNECT": "tcp/a:1"}
    found = {fix: message for _, message, fix in problems(check_environment(wrong, versions()))}
    assert set(found) == {"unset MJPLUG_SIM__SPED", "unset MJPLUG_MODELL", "unset ROS_DOMAIN_ID"}
    assert "did you mean 'speed'" in found["unset MJPLUG_SIM__SPED"]
    told = [
        finding.message
        for finding in check_environment(
            {"MJPLUG_SIM__SPEED": "2", "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, versions()
        )
        if finding.level == "note"
    ]
    assert told[0] == "MJPLUG_SIM__SPEED: overrides configuration files"
    assert told[1].startswith("RMW_IMPLEMENTATION=rmw_fastrtps_cpp: ROS 2 nodes started here do not discover")


def drawing(**works):
    return lambda backend: (backend in works, works.get(backend, f"libraries of {backend} are missing"))


def test_the_backend_that_cameras_draw_through_is_named():
    findings = list(check_graphics({}, drawing(egl="NVIDIA RTX", osmesa="llvmpipe (LLVM 15)"), "linux"))
    assert [(finding.level, finding.message.partition(":")[0]) for finding in findings] == [
        ("ok", "egl"), ("note", "osmesa"), ("note", "glfw"),
    ]  # fmt: skip
    assert findings[0].message == "egl: cameras render with it: NVIDIA RTX"
    assert "(software rendering; " in findings[1].message
    assert findings[2].message == "glfw: does not work: no display"


def test_with_a_display_glfw_comes_first():
    findings = list(check_graphics({"DISPLAY": ":0"}, drawing(glfw="Mesa Intel", egl="Mesa Intel"), "linux"))
    assert findings[0].message == "glfw: cameras render with it: Mesa Intel"
    assert findings[2].fix == "apt-get install libosmesa6"


def test_without_any_opengl_the_packages_are_named():
    *_, last = check_graphics({}, drawing(), "linux")
    assert (last.level, last.fix) == ("warning", "apt-get install libegl1 libgl1")


def test_a_choice_that_does_not_work_is_an_error_with_one_that_does():
    *_, last = check_graphics({"MUJOCO_GL": "osmesa"}, drawing(egl="NVIDIA"), "linux")
    assert (last.level, last.message) == ("error", "MUJOCO_GL=osmesa does not work on this machine")
    assert last.fix == "export MUJOCO_GL=egl, or unset MUJOCO_GL"


def test_a_backend_that_does_not_exist_is_tried_in_a_process_that_may_fail():
    works, said = draw("no_such_backend")
    assert not works
    assert "no_such_backend" in said


@pytest.mark.slow
def test_the_backends_of_this_machine_are_tried(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "broken")
    tried = {backend: draw(backend) for backend in ("egl", "osmesa")}
    assert all(said for _, said in tried.values())


def test_a_free_port_and_a_running_server_are_both_fine(tour):
    free = on_free_port("tcp/127.0.0.1:0")
    (finding,) = check_network(free)
    assert (finding.level, finding.message) == ("ok", f"no program listens at {free}")
    (finding,) = check_network(tour.endpoint)
    assert finding.level == "ok"
    assert finding.message.startswith("server /mjplug (mjplug ")


def test_a_program_in_the_way_is_an_error_with_the_way_around():
    with socket.create_server(("127.0.0.1", 0)) as other:
        (finding,) = check_network(f"tcp/127.0.0.1:{other.getsockname()[1]}")
    assert (finding.level, "end it, or serve with --listen" in finding.fix) == ("error", True)
    assert re.search(r"did not answer within [\d.]+ s, but accepts connections", finding.message)
    (finding,) = check_network("nonsense")
    assert "is not a Zenoh endpoint" in finding.message
    (finding,) = check_network("tcp/robot..lab:7447")
    assert finding.level == "ok"


def test_a_server_that_needs_a_password_is_not_taken_for_another_program(tmp_path):
    (tmp_path / "users.txt").write_text("alice:secret\n")
    settings = {"dictionary_file": "users.txt", "user": "server", "password": "own"}
    (tmp_path / "server.json5").write_text(json.dumps({"transport": {"auth": {"usrpwd": settings}}}))
    with open_server("bundled:box", zenoh_config=tmp_path / "server.json5", listen="tcp/127.0.0.1:0") as server:
        (finding,) = check_network(server.endpoint)
    assert finding.level == "error"
    assert "accepts connections, but not this client: it may need a certificate or password" in finding.message


def test_a_server_is_opened_for_a_moment_and_asked_for_steps(monkeypatch):
    monkeypatch.setenv("MJPLUG_SIM__SPED", "2")
    (finding,) = check_server()
    assert finding.level == "ok"
    assert re.fullmatch(
        r"a server with bundled:arm starts in \d+\.\d s and answers in \d+ ms: took 100 steps; t = 0.200000 s",
        finding.message,
    )
    (finding,) = check_server("bundled:arn")
    assert (finding.level, finding.fix) == ("error", "mjplug serve bundled:arn --verbose")
    assert "did you mean 'arm'" in finding.message


def test_scheduling_is_measured_and_changes_nothing_in_this_thread():
    before = os.sched_getscheduler(0)
    messages = [finding.message for finding in check_scheduling()]
    assert os.sched_getscheduler(0) == before
    assert [message.partition(":")[0] for message in messages[:3]] == [
        "scheduler slice", "timer slack", "MuJoCo's step timer",
    ]  # fmt: skip
    assert "wakes up" in messages[-1]


@pytest.mark.slow
def test_the_command_shows_all_of_it_and_ends_with_1_if_something_does_not_work(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "999")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    free = on_free_port("tcp/127.0.0.1:0")
    done = typed("doctor", "-e", free)
    assert done.code == 1
    assert [line for line in done.lines if not line.startswith(" ")][:-1] == [
        "environment", "network", "server", "scheduling", "graphics",
    ]  # fmt: skip
    assert "           -> unset ROS_DOMAIN_ID" in done.lines
    assert done.lines[-1].startswith("1 error, ")
    monkeypatch.delenv("ROS_DOMAIN_ID")
    done = typed("doctor", "--json", "-e", free)
    told = json.loads(done.out)
    assert (done.code, told["errors"]) == (0, 0)
    topics = {finding["topic"] for finding in told["findings"]}
    assert topics == {"environment", "network", "server", "scheduling", "graphics"}
