"""Ctrl-C while a command is still importing its modules."""

import subprocess
import sys

import pytest
from cli.process import environment

PROGRAM = """\
import os, signal, sys
from importlib.abc import MetaPathFinder


class Interrupting(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)


if {pressed}:
    # A test run in the background ignores the signal, and so would this program.
    signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupting())
sys.argv = ["mjplug", *{words!r}]
from mjplug.cli import main
main()
print("not interrupted")
"""

SERVE = ("serve", "bundled:box", "--listen", "tcp/127.0.0.1:0")


def interrupted(module, *words, **variables):
    """Presses Ctrl-C at the moment when a command imports a module."""
    program = PROGRAM.format(module=module, words=words, pressed=True)
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(variables), capture_output=True, text=True, timeout=40.0, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("mjplug.cli.interrupt", ("--help",)),
        ("mjplug.cli.quick_completion", ("--help",)),
        ("mjplug.cli.app", ("--help",)),
        ("typer", ("topic", "list")),
        ("zenoh", ("topic", "list")),
        ("pydantic", ("topic", "list")),
        ("mjplug_schemas.registry", ("interface", "list")),
        ("mujoco", SERVE),
        ("mjplug.server.prepared", SERVE),
        ("mjplug.config.load", ("config", "show", "bundled:box")),
    ],
)
def test_ctrl_c_during_an_import_ends_with_130_and_without_a_word(module, words):
    assert interrupted(module, *words) == (130, "", "")


@pytest.mark.parametrize("module", ["mjplug.cli.quick_completion", "zenoh"])
def test_ctrl_c_after_tab_prints_nothing(module):
    asking = {"COMP_WORDS": "mjplug topic echo /cl", "COMP_CWORD": "3", "_MJPLUG_COMPLETE": "complete_bash"}
    assert interrupted(module, **asking) == (130, "", "")


def test_ctrl_c_after_tab_prints_nothing_where_typer_answers():
    asking = {"COMP_WORDS": "mjplug interface show std", "COMP_CWORD": "3", "_MJPLUG_COMPLETE": "complete_bash"}
    assert interrupted("mjplug_schemas.registry", **asking) == (130, "", "")


def test_nothing_is_imported_before_ctrl_c_is_handled():
    program = "import sys; before = set(sys.modules); import mjplug.cli; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment(), capture_output=True, text=True, timeout=40.0, check=True
    )
    assert done.stdout.split() == ["mjplug", "mjplug.cli"]


def test_an_ignored_ctrl_c_stays_ignored():
    program = PROGRAM.format(module="typer", words=["--help"], pressed=False)
    done = subprocess.run(
        ["sh", "-c", 'trap "" INT; "$@"', "sh", sys.executable, "-c", program],
        env=environment(), capture_output=True, text=True, timeout=40.0, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert "Usage: mjplug" in done.stdout
