"""The layers of pyproject.toml, each broken on purpose in a copy of the source."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

VIOLATIONS = {
    "a lower layer uses the command line": (
        "mjplug/server/starting_pose.py",
        "import mjplug.cli.output",
        "mjplug.server is not allowed to import mjplug.cli",
    ),
    "the server uses the test kit": (
        "mjplug/server/offline.py",
        "import mjplug.testing.world",
        "mjplug.server is not allowed to import mjplug.testing",
    ),
    "physics uses the wire": (
        "mjplug/physics/loop.py",
        "import mjplug.wire.session",
        "mjplug.physics is not allowed to import mjplug.wire",
    ),
    "the view uses physics": (
        "mjplug/view/outbox.py",
        "import mjplug.physics.reset",
        "mjplug.view is not allowed to import mjplug.physics",
    ),
    "a plugin uses the server": (
        "plugins/mjplug_plugins/heartbeat.py",
        "import mjplug.server.starting_pose",
        "mjplug_plugins is not allowed to import mjplug",
    ),
    "a plugin uses a private part of the plugin API": (
        "plugins/mjplug_plugins/odometry.py",
        "import mjplug.plugin.guard",
        "mjplug_plugins.odometry -> mjplug.plugin.guard",
    ),
    "two modules of a folder import one another": (
        "mjplug/physics/inbox.py",
        "import mjplug.physics.loop",
        "No cycles are allowed in mjplug.physics",
    ),
}


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the source, which a test may change, with a command that checks its layers."""
    folder = tmp_path_factory.mktemp("layers")
    for package in ("mjplug", "schemas/mjplug_schemas", "plugins/mjplug_plugins"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)

    def lint():
        # The folders of the copy come before the installed packages.
        script = (
            f"import sys; sys.path[:0] = {[str(folder / part) for part in ('', 'schemas', 'plugins')]!r}; "
            "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-cache'])"
        )
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True, timeout=120)
        return done.returncode, " ".join((done.stdout + done.stderr).split())

    return folder, lint


def test_the_source_keeps_its_layers_and_every_violation_is_caught(copied):
    folder, lint = copied
    assert lint()[0] == 0
    for file, line, _ in VIOLATIONS.values():
        path = folder / file
        path.write_text(path.read_text() + f"\n{line}\n")
    code, said = lint()
    assert code == 1
    missed = [name for name, (_, _, sentence) in VIOLATIONS.items() if sentence not in said]
    assert not missed, said


def test_a_new_package_needs_a_place_among_the_layers(copied):
    folder, lint = copied
    (folder / "mjplug" / "novelty.py").write_text("import mjplug.cli\n")
    code, said = lint()
    assert code == 1
    assert "mjplug.novelty" in said
