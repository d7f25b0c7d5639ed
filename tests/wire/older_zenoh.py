"""Python environments with older Zenoh versions, for peers that are older than the server."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

TIMEOUT = 90.0
"""How long an installation may take [s]; 1 s if the packages are on this machine already."""


def python_with(zenoh_version: str, folder: Path) -> str:
    """Makes an environment with the foreign peer and a version of Zenoh; returns its Python.

    Where that fails, as it does without a package registry, the test is skipped. With `CI` in the environment it fails.
    """
    uv = shutil.which("uv") or next(
        (str(place) for name in (".venv", ".uv") if (place := ROOT / name / "bin" / "uv").exists()), None
    )
    if uv is None:
        _give_up("uv is not installed")
    python = folder / "bin" / "python"
    wanted = [f"eclipse-zenoh=={zenoh_version}", f"zenoh-ros2-sdk=={version('zenoh-ros2-sdk')}"]
    commands = (
        [uv, "venv", "--quiet", "--python", sys.executable, str(folder)],
        [uv, "pip", "install", "--quiet", "--only-binary", ":all:", "--python", str(python), *wanted],
    )
    for command in commands:
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            _give_up(f"Zenoh {zenoh_version} was not installed within {TIMEOUT:.0f} s")
        if done.returncode != 0:
            _give_up(f"Zenoh {zenoh_version} cannot be installed: {done.stderr.strip()}")
    return str(python)


def _give_up(reason: str) -> None:
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)
