"""What the TAB key completes."""

import inspect
import resource
import subprocess
import sys
import time

import pytest
from cli.process import COMMAND, STARTING, environment

from mjplug.cli import names, quick_completion
from mjplug.cli.action import app as action_app
from mjplug.cli.app import main as typer_main
from mjplug.cli.service import app as service_app
from mjplug.cli.topic import app as topic_app
from mjplug.client import connect


def complete(*words, **variables):
    """Presses TAB after the last word, as bash does; returns the answers."""
    asking = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1), "_MJPLUG_COMPLETE": "complete_bash"}
    done = subprocess.run(
        COMMAND, env=environment({**asking, **variables}), capture_output=True, text=True, timeout=STARTING, check=False
    )
    assert done.stderr == ""
    return done.stdout.split()


def complete_live(*words, **variables):
    """Repeats completion until it returns something: on a busy machine, a server may take longer than a second."""
    until = time.monotonic() + STARTING
    while not (found := complete(*words, **variables)):
        assert time.monotonic() < until, words
    return found


def test_tab_completes_commands_flags_and_names_that_are_installed():
    assert complete("mjplug", "to") == ["top", "topic"]
    assert complete("mjplug", "topic", "hz", "--win") == ["--window"]
    assert complete("mjplug", "interface", "show", "std_srvs/srv/T") == ["std_srvs/srv/Trigger"]
    assert complete("mjplug", "plugin", "info", "hea") == ["heartbeat"]


def test_tab_completes_what_a_server_is_started_with():
    models = ["bundled:arm", "bundled:box", "bundled:mobile_base", "bundled:quadruped"]
    assert complete("mjplug", "serve", "bund") == models
    assert complete("mjplug", "config", "init", "bundl") == models
    # File names are the shell's.
    assert complete("mjplug", "serve", "rob") == []
    assert complete("mjplug", "serve", "bundled:arm", "--plugin", "hea") == ["heartbeat"]
    assert complete("mjplug", "serve", "bundled:quadruped", "--keyframe", "ho") == ["home"]
    assert complete("mjplug", "serve", "no_such.xml", "--keyframe", "ho") == []


def test_files_are_completed_beside_bundled_models(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bumper.xml").touch()
    assert names.complete_model("bu")[-1] == "bumper.xml"
    assert names.complete_model("") == []


def test_tab_completes_the_keyframes_of_the_model_in_a_configuration_file(tmp_path, monkeypatch):
    (tmp_path / "robot.yaml").write_text("model: bundled:quadruped\n")
    monkeypatch.chdir(tmp_path)
    assert complete("mjplug", "serve", "robot.yaml", "--keyframe", "ho") == ["home"]


def test_tab_completes_types_of_the_right_kind():
    assert complete("mjplug", "topic", "find", "std_msgs/msg/Str") == ["std_msgs/msg/String"]
    assert complete("mjplug", "service", "find", "std_srvs/srv/T") == ["std_srvs/srv/Trigger"]
    assert complete("mjplug", "topic", "find", "std_srvs/") == []


def test_tab_completes_names_of_servers_and_of_their_parameters(tour):
    connect = {"MJPLUG_CONNECT": tour.endpoint}
    assert complete("mjplug", "topic", "list", "--server", "/mj", **connect) == ["/mjplug"]
    assert complete("mjplug", "node", "info", "/", **connect) == ["/mjplug"]
    assert complete("mjplug", "param", "get", "/mjplug", "sim.sp", **connect) == ["sim.speed"]


def test_tab_completes_the_keyframes_of_a_bundled_model_that_is_running(serve):
    server = serve("bundled:quadruped", "--paused")
    assert complete("mjplug", "sim", "reset", "-k", "ho", MJPLUG_CONNECT=server.endpoint) == ["home"]


def test_tab_completes_the_saved_states_of_a_server(serve, tmp_path):
    server = serve("bundled:box", "--paused", "--set", f"snapshots.folder={tmp_path}")
    with connect(server.endpoint) as client:
        for name, file in (("grasp", False), ("grown", False), ("start", False), ("growing", True)):
            client.save(name, file=file)
    live = {"MJPLUG_CONNECT": server.endpoint}
    assert complete_live("mjplug", "sim", "restore", "gr", **live) == ["grasp", "grown"]
    assert complete_live("mjplug", "sim", "delete-state", "s", **live) == ["start"]
    assert complete_live("mjplug", "sim", "restore", "--file", "gr", **live) == ["growing"]
    assert complete("mjplug", "sim", "save", "gr", **live) == []
    assert complete("mjplug", "sim", "restore", "gr", MJPLUG_CONNECT="tcp/127.0.0.1:1") == []


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_complete_saved_states_too(serve, shell):
    server = serve("bundled:box", "--paused")
    with connect(server.endpoint) as client:
        client.save("grasp")
    line = "mjplug sim restore gr"
    asking = {
        "_MJPLUG_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args", "COMP_WORDS": line, "COMP_CWORD": "3",
        "MJPLUG_CONNECT": server.endpoint,
    }  # fmt: skip
    done = subprocess.run(
        COMMAND, env=environment(asking), capture_output=True, text=True, timeout=STARTING, check=False
    )
    assert "grasp" in done.stdout
    assert done.stderr == ""


def test_bash_takes_a_colon_for_the_end_of_a_word(tour):
    assert complete("mjplug", "serve", "bundled", ":", "q") == ["quadruped"]
    assert complete("mjplug", "serve", "bundled", ":") == ["arm", "box", "mobile_base", "quadruped"]
    assert complete("mjplug", "serve", "bundled", ":", "quadruped", "--keyframe", "ho") == ["home"]
    host, port = tour.endpoint.rsplit(":", 1)
    assert complete("mjplug", "topic", "echo", "-e", host, ":", port, "/cl") == ["/clock"]


def test_tab_completes_live_names_in_less_than_a_quarter_of_a_second(tour):
    spent = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert complete_live("mjplug", "topic", "echo", "/cl", MJPLUG_CONNECT=tour.endpoint) == ["/clock"]
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    # Time of the process itself: others may have the processor meanwhile.
    assert min(spent) < 0.25
    assert complete("mjplug", "service", "call", "/mjplug/set_pa", "-e", tour.endpoint) == []
    found = complete_live("mjplug", "service", "call", "-e", tour.endpoint, "/mjplug/set_pa")
    assert found == ["/mjplug/set_parameters", "/mjplug/set_parameters_atomically", "/mjplug/set_pause"]


def test_completion_returns_nothing_without_a_server():
    assert complete("mjplug", "topic", "echo", "/cl", MJPLUG_CONNECT="tcp/127.0.0.1:1") == []
    assert complete("mjplug", "topic", "echo", "/cl", MJPLUG_CONNECT="nonsense") == []


def test_completion_imports_nothing_slow(tour):
    asking = {"COMP_WORDS": "mjplug topic echo /cl", "COMP_CWORD": "3", "_MJPLUG_COMPLETE": "complete_bash"}
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "mjplug"],
        env=environment({**asking, "MJPLUG_CONNECT": tour.endpoint}),
        capture_output=True, text=True, timeout=STARTING, check=False,
    )  # fmt: skip
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "zenoh" in imported
    assert not imported & {"mujoco", "numpy", "yaml", "typer", "pydantic", "mjplug_schemas.message", "mjplug.client"}


@pytest.mark.parametrize(
    ("group", "app", "completer"),
    [
        ("topic", topic_app, names.complete_topic),
        ("service", service_app, names.complete_service),
        ("action", action_app, names.complete_action),
    ],
)
def test_what_is_answered_quickly_are_all_commands_that_take_such_a_name(group, app, completer):
    taking = set()
    for command in app.registered_commands:
        first = next(iter(inspect.signature(command.callback).parameters.values()))
        extras = getattr(first.annotation, "__metadata__", ())
        if any(getattr(extra, "autocompletion", None) is completer for extra in extras):
            taking.add(command.name or command.callback.__name__)
    assert quick_completion.COMMANDS[group][1] == taking


QUESTIONS = ("topic echo /cl", "service call /mjplug/set_p", "topic info /nope", "teleop /cl", "record /cl")
ANSWERED = ("topic echo /cl", "teleop /cl", "record /cl")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "fish is-args"])
def test_a_shell_gets_the_same_completions_with_and_without_typer(tour, shell, monkeypatch, capsys):
    monkeypatch.setenv("MJPLUG_CONNECT", tour.endpoint)
    name, _, action = shell.partition(" ")
    for line in QUESTIONS:
        words = ["mjplug", *line.split()]
        asking = {
            "_MJPLUG_COMPLETE": f"complete_{name}", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1),
            "_TYPER_COMPLETE_ARGS": " ".join(words), "_TYPER_COMPLETE_FISH_ACTION": action or "get-args",
        }  # fmt: skip
        for variable, value in asking.items():
            monkeypatch.setenv(variable, value)
        expected = "/clock" if line in ANSWERED and not action else ""
        quick, typed = (answered(answer, capsys, expected) for answer in (quick_completion.answer, typer_main))
        assert quick == typed, line
        assert ("/clock" in quick[0]) == bool(expected), line


def answered(answer, capsys, expected):
    """Returns the completions and the exit code; repeats the query while the expected ones are missing."""
    until = time.monotonic() + STARTING
    while True:
        code = 0
        try:
            answer()
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr().out.strip()
        if expected in printed or time.monotonic() > until:
            return printed, code


def test_what_cannot_be_answered_quickly_is_left_to_typer(monkeypatch):
    monkeypatch.setenv("_MJPLUG_COMPLETE", "complete_bash")
    for words in ("mjplug topic echo '/cl", "mjplug topic echo --on", "mjplug topic list /c", "mjplug sim speed 1"):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", "3")
        assert not quick_completion.answer()
    monkeypatch.setenv("_MJPLUG_COMPLETE", "source_bash")
    assert not quick_completion.answer()
